//! The simulated instrument against closed forms.

use std::f64::consts::TAU;
use trihedron::simulate::mechanism::{Bridge, creep, first_order, play, second_order};
use trihedron::simulate::noise::flicker_poles;
use trihedron::simulate::random::Stream;
use trihedron::simulate::sampling::{Adc, resample};

/// Equal to the last bit.
fn same((a, b): (&f64, f64)) -> bool {
    a.to_bits() == b.to_bits()
}

fn one_channel(values: impl Iterator<Item = f64>) -> Vec<[f64; 3]> {
    values.map(|v| [v; 3]).collect()
}

#[test]
fn normal_deviates_have_the_normal_distribution() {
    let n = 2_000_000;
    let mut stream = Stream::new(11);
    // P(x < edge), from tables of the normal distribution; the last two reach into the ziggurat's tail.
    let edges = [
        (-1.0, 0.158_655_253_931_457),
        (0.0, 0.5),
        (0.3, 0.617_911_422_188_953),
        (2.0, 0.977_249_868_051_821),
        (3.7, 0.999_892_200_266_523),
        (-4.2, 1.334_574_901_590_631e-5),
    ];
    let mut below = [0.0_f64; 6];
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..n {
        let x = stream.normal();
        sum += x;
        squares += x * x;
        for (count, (edge, _)) in below.iter_mut().zip(edges) {
            *count += f64::from(u8::from(x < edge));
        }
    }
    let n = f64::from(n);
    for (count, (edge, p)) in below.iter().zip(edges) {
        // Four standard deviations of a binomial count.
        let limit = 4.0 * (n * p * (1.0 - p)).sqrt();
        assert!(
            (count - n * p).abs() < limit,
            "below {edge}: {count} of {n}"
        );
    }
    assert!((sum / n).abs() < 4.0 / n.sqrt());
    assert!((squares / n - 1.0).abs() < 4.0 * (2.0 / n).sqrt());
}

#[test]
fn a_resonator_settles_on_a_step_as_its_closed_form_says() {
    let (dt, f0, q) = (1e-3, 12.0, 2.5);
    let w = TAU * f0;
    // Straight lines between samples: the step is a ramp of one dt, whose exact response is the integral of the step's.
    let mut x = one_channel((0..400).map(|i| f64::from(u8::from(i > 0))));
    second_order(&mut x, dt, &[f0; 3], &[q; 3]).expect("legal question");
    let (damping, ringing) = (w / (2.0 * q), w * (1.0 - 1.0 / (4.0 * q * q)).sqrt());
    // ∫0^t step response: t - c + e^{-dt}(c cos + ((c d - 1)/ω) sin) with c = 1/(Q w).
    let c = 1.0 / (q * w);
    let integral = |t: f64| {
        if t <= 0.0 {
            return 0.0;
        }
        let (s, co) = (ringing * t).sin_cos();
        t - c + (-damping * t).exp() * (c * co + (c * damping - 1.0) / ringing * s)
    };
    for (i, row) in x.iter().enumerate() {
        let t = i as f64 * dt;
        let exact = (integral(t) - integral(t - dt)) / dt;
        assert!((row[0] - exact).abs() < 1e-11, "{i}: {} {exact}", row[0]);
    }
}

#[test]
fn stages_rest_at_rest_and_far_too_stiff_ones_follow_at_once() {
    let mut x = one_channel((0..50).map(|_| 3.0));
    second_order(&mut x, 0.01, &[5.0; 3], &[0.7; 3]).expect("legal question");
    first_order(&mut x, 0.01, &[1.0; 3]).expect("legal question");
    creep(&mut x, 0.01, &[0.01; 3], &[20.0; 3]).expect("legal question");
    play(&mut x, &[1.0; 3], &[0.1; 3]).expect("legal question");
    assert!(x.iter().flatten().all(|v| (v - 3.0).abs() < 1e-12));
    let mut ramp = one_channel((0..50).map(f64::from));
    // 5 kHz and Q = 0.02: the slow root of an overdamped pair sits at 100 Hz, still settled within one 0.1 s step.
    second_order(&mut ramp, 0.1, &[5000.0; 3], &[0.02; 3]).expect("legal question");
    let lag = 1.0 / (0.02 * TAU * 5000.0) / 0.1;
    assert!((ramp[40][1] - (40.0 - lag)).abs() < 1e-9);
    assert!(second_order(&mut ramp, 0.1, &[0.0; 3], &[1.0; 3]).is_err());
    assert!(first_order(&mut ramp, 0.1, &[-1.0; 3]).is_err());
}

#[test]
fn equal_plates_read_two_xi_over_four_minus_xi_squared() {
    for x in [-0.7, -0.1, 0.0, 1e-4, 0.3, 0.9] {
        let exact = 2.0 * x / (4.0 - x * x);
        assert!((Bridge::voltage(x, 0.0) - exact).abs() < 1e-15);
    }
}

#[test]
fn mismatched_plates_keep_rest_at_zero_and_the_small_signal_gain_at_one() {
    let bridge = Bridge {
        deflection: [1e-3; 3],
        second: [0.0; 3],
        third: [0.0; 3],
        mismatch: [0.05, -0.1, 0.0],
    };
    let h = 1e-3;
    let mut x = one_channel([0.0, h, -h].into_iter());
    bridge.respond(&mut x).expect("legal question");
    for k in 0..3 {
        assert!(x[0][k].abs() < 1e-12);
        assert!(((x[1][k] - x[2][k]) / (2.0 * h) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn resampling_is_exact_for_cubics_and_refuses_what_lies_outside() {
    let f = |t: f64| 1.0 + t * (2.0 + t * (-0.5 + 0.25 * t));
    let signal = one_channel((0..20).map(|i| f(0.1 * f64::from(i) - 0.3)));
    let times = [-0.3, -0.25, 0.0, 0.777, 1.5, 1.6];
    let out = resample(&signal, -0.3, 0.1, &times).expect("legal question");
    for (row, t) in out.iter().zip(times) {
        assert!((row[0] - f(t)).abs() < 1e-13);
    }
    assert!(resample(&signal, -0.3, 0.1, &[1.7]).is_err());
    assert!(resample(&signal[..3], -0.3, 0.1, &[0.0]).is_err());
}

#[test]
fn a_converter_rounds_clips_skips_codes_and_sleeps_in_its_dead_band() {
    let converter = Adc {
        lsb: 0.5,
        low: -4.0,
        high: 4.0,
        dead_band: 0.8,
        bias: [0.0, 1.0, 0.0],
        missing_every: 5,
    };
    let mut x = one_channel([0.6, 1.1, 2.4, 2.6, 9.0, -9.0].into_iter());
    converter.convert(&mut x).expect("legal question");
    // Code 5 (2.5) and code 0 are missing; 0.6 is asleep in channels 1 (at 0, whose code is missing) and 2 (at 1).
    assert!(x[0].iter().zip([-0.5, 1.0, -0.5]).all(same));
    assert!(x[1].iter().zip([1.0; 3]).all(same));
    assert_eq!(x[2][0].to_bits(), 2.0_f64.to_bits());
    assert_eq!(x[3][0].to_bits(), 2.0_f64.to_bits());
    assert!([x[4][0], x[5][0]].iter().zip([4.0, -4.0]).all(same));
    let malformed = Adc {
        low: 5.0,
        ..converter
    };
    assert!(malformed.convert(&mut x).is_err());
}

#[test]
fn flicker_poles_add_up_to_one_over_f() {
    let (n, dt) = (1_000_000, 0.01);
    let poles = flicker_poles(n, dt);
    let mut f = 1.0 / (n as f64 * dt);
    while f < 0.4 / dt {
        let w = TAU * f;
        // Discrete spectrum of the sampled processes, two-sided.
        let psd: f64 = poles
            .iter()
            .map(|(p, variance)| {
                let keep = (-p * dt).exp();
                variance * dt * (1.0 - keep * keep)
                    / (1.0 - 2.0 * keep * (w * dt).cos() + keep * keep)
            })
            .sum();
        // Ripple 0.3 %; at both ends of the band the sum is cut, at the upper one aliasing nearly makes up for it.
        assert!((psd * w - 1.0).abs() < 0.07, "{f} Hz: {}", psd * w);
        f *= 1.3;
    }
}
