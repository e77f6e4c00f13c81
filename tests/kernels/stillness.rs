//! Blocks: the mean and the variance that the definition gives, gaps skipped, offsets harmless.

use trihedron::simd::Instructions;
use trihedron::stillness::{block_statistics, block_statistics_with};

#[test]
fn a_large_offset_costs_no_digits_of_the_variance() {
    let readings: Vec<f64> = (0..8).flat_map(|k| [1e9 + f64::from(k % 2); 3]).collect();
    let blocks = block_statistics(&readings, 8).expect("legal question");
    // Eight readings alternating by one: 8 * 0.25 / 7.
    assert!((blocks.variance[0][0] - 2.0 / 7.0).abs() < 1e-12);
}

#[test]
fn every_instruction_set_gives_the_two_pass_statistics_of_any_block_length() {
    let value = |k: usize| match k % 997 {
        0 => f64::INFINITY,
        _ => 9.8 + (12.9898 * k as f64).sin() * 0.3,
    };
    for length in [2, 3, 7, 8, 9, 16, 41, 200] {
        let mut readings: Vec<f64> = (0..3 * (17 * length + 1)).map(value).collect();
        readings[3 * length..6 * length].fill(f64::NAN);
        for &set in Instructions::offered() {
            let found = block_statistics_with(set, &readings, length).expect("legal question");
            assert_eq!(found.count.len(), 17);
            for (block, rows) in readings.chunks_exact(3 * length).enumerate() {
                let good: Vec<&[f64]> = rows
                    .chunks_exact(3)
                    .filter(|row| row.iter().all(|x| x.is_finite()))
                    .collect();
                assert_eq!(found.count[block] as usize, good.len());
                if good.is_empty() {
                    assert!(found.mean[block].iter().all(|x| x.is_nan()));
                    continue;
                }
                for axis in 0..3 {
                    let n = good.len() as f64;
                    let mean = good.iter().map(|row| row[axis]).sum::<f64>() / n;
                    let square: f64 = good.iter().map(|row| (row[axis] - mean).powi(2)).sum();
                    // Sums of up to 200 terms of order ten, and squares of order one.
                    assert!((found.mean[block][axis] - mean).abs() < 1e-13);
                    if good.len() > 1 {
                        assert!((found.variance[block][axis] - square / (n - 1.0)).abs() < 1e-13);
                    }
                }
            }
        }
    }
}
