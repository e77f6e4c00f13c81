//! Random numbers: xoshiro256++ for bits, the ziggurat for normal deviates. One key, one stream, on every machine.

use std::sync::OnceLock;

/// Where the ziggurat of 256 layers ends and the tail begins.
const TAIL: f64 = 3.654_152_885_361_009;
/// Width of the bottom layer, tail included: area of a layer over the density at [`TAIL`].
const BASE: f64 = 3.910_757_959_537_09;

struct Ziggurat {
    /// Right edges of the layers, from the bottom; one more than there are layers.
    x: [f64; 257],
    /// Density `exp(-x²/2)` at the edges.
    f: [f64; 257],
}

fn ziggurat() -> &'static Ziggurat {
    static TABLE: OnceLock<Ziggurat> = OnceLock::new();
    TABLE.get_or_init(|| {
        let density = |x: f64| (-0.5 * x * x).exp();
        let area = BASE * density(TAIL);
        let mut x = [0.0; 257];
        x[0] = BASE;
        x[1] = TAIL;
        for i in 2..256 {
            x[i] = (-2.0 * (area / x[i - 1] + density(x[i - 1])).ln()).sqrt();
        }
        Ziggurat {
            x,
            f: x.map(density),
        }
    })
}

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub struct Stream {
    state: [u64; 4],
}

impl Stream {
    /// The stream of a key (splitmix64 spreads the key over the state).
    #[must_use]
    pub fn new(key: u64) -> Self {
        let mut s = key;
        let state = [(); 4].map(|()| {
            s = s.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = s;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        });
        Self { state }
    }

    /// 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        let [a, b, c, d] = self.state;
        let out = a.wrapping_add(d).rotate_left(23).wrapping_add(a);
        let c = c ^ a;
        let d = d ^ b;
        self.state = [a ^ d, b ^ c, c ^ (b << 17), d.rotate_left(45)];
        out
    }

    /// Uniform in (0, 1).
    #[inline]
    pub fn uniform(&mut self) -> f64 {
        ((self.bits() >> 12) as f64 + 0.5) * 2.0_f64.powi(-52)
    }

    /// Standard normal.
    #[inline]
    pub fn normal(&mut self) -> f64 {
        let table = ziggurat();
        loop {
            let bits = self.bits();
            let layer = (bits & 0xff) as usize;
            // The layer takes the low 8 bits, the place in it the high 52: independent.
            let u = ((bits >> 12) as f64 + 0.5).mul_add(2.0_f64.powi(-51), -1.0);
            let x = u * table.x[layer];
            if x.abs() < table.x[layer + 1] {
                return x;
            }
            if layer == 0 {
                // Marsaglia's tail.
                loop {
                    let beyond = -self.uniform().ln() / TAIL;
                    if -2.0 * self.uniform().ln() >= beyond * beyond {
                        return (TAIL + beyond).copysign(u);
                    }
                }
            }
            let (low, high) = (table.f[layer], table.f[layer + 1]);
            if low + (high - low) * self.uniform() < (-0.5 * x * x).exp() {
                return x;
            }
        }
    }
}
