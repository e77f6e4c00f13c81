//! Shaping filters: the identified noise terms as the output of a linear system driven by white noise.

use std::f64::consts::{LN_2, PI};

use nalgebra::{DMatrix, DVector};

use super::discretisation::discretise;
use super::rounding::undithered_variance;
use crate::error::{Error, Result};

/// Noise of one axis by the coefficients of its Allan deviation, in the raw unit `u` of the axis.
///
/// Two-sided spectra: `(2πf)² Q²`, `N²`, `B²/(2πf)`, `(K/2πf)²`; the ramp is a drift of slope `R`.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseTerms {
    /// Quantisation of the integrated output, u·s: a first difference of white noise.
    pub quantisation: f64,
    /// White noise, u/√Hz.
    pub white: f64,
    /// Bias instability (flicker) coefficient, u; the flat Allan deviation is 0.664 B.
    pub flicker: f64,
    /// Random walk of the output, u/√s.
    pub walk: f64,
    /// Standard deviation of the slope of the drift, u/s.
    pub ramp: f64,
    /// Standard deviation of a Gauss-Markov process identified in the noise, u.
    pub gauss_markov: f64,
    /// Its inverse correlation time, 1/s.
    pub gauss_markov_rate: f64,
    /// Resolution (LSB) of the reading itself, u.
    pub resolution: f64,
}

/// How the terms are represented by states.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapingModel {
    /// The noise terms.
    pub terms: NoiseTerms,
    /// Inverse correlation times β [1/s] of the Gauss-Markov processes that represent flicker, increasing.
    pub flicker_rates: Vec<f64>,
    /// Undamped natural frequency ω₀ [rad/s] of the second-order process that represents the ramp.
    pub ramp_frequency: f64,
    /// Its damping ratio ζ.
    pub ramp_damping: f64,
    /// Noise of one sample before the ADC, u; zero where a reading is a single conversion.
    pub dither: f64,
    /// Whether a reading is the mean over its pose (exact) or the value at its end (the article's 8 states).
    pub averages: bool,
}

/// Peak of the Allan variance of a Gauss-Markov process of unit variance, at τ = 1.893/β (docs/kalman.md, eq. 6).
const GAUSS_MARKOV_PEAK: f64 = 0.381_138_658;

/// Variance of the slowest and the fastest of several Gauss-Markov processes, over that of the others.
///
/// With one process per decade from 0.3/T to 6/P (P: length of a pose) the Allan deviation then follows 0.664 B within
/// 2 % between one pose and a third of the session T.
const END_SHARE: f64 = 1.25;

/// The continuous system behind a [`ShapingModel`], with states of unit amplitude: `n(t) = h·s`.
#[derive(Debug, Clone)]
pub struct Shaping {
    pub(crate) f: DMatrix<f64>,
    pub(crate) qc: DMatrix<f64>,
    pub(crate) h: DVector<f64>,
    pub(crate) p0: DMatrix<f64>,
    averages: bool,
    quantisation: f64,
}

/// Positions of the states of the discrete system.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Whether state 0 is the running mean of the current pose.
    pub averages: bool,
    /// Whether two states hold the quantisation errors at the end and the start of the pose.
    pub quantises: bool,
    /// Number of slow states (flicker, walk, ramp).
    pub n_slow: usize,
}

impl Layout {
    /// First slow state.
    #[must_use]
    pub fn first_slow(self) -> usize {
        usize::from(self.averages) + 2 * usize::from(self.quantises)
    }

    /// Number of noise states.
    #[must_use]
    pub fn n(self) -> usize {
        self.first_slow() + self.n_slow
    }
}

impl ShapingModel {
    fn check(&self) -> Result<()> {
        let t = &self.terms;
        for (name, value) in [
            ("quantisation", t.quantisation),
            ("white", t.white),
            ("flicker", t.flicker),
            ("walk", t.walk),
            ("ramp", t.ramp),
            ("Gauss-Markov", t.gauss_markov),
            ("resolution", t.resolution),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(Error::bad_input(format!(
                    "the {name} coefficient of the noise must be zero or positive, got {value}"
                )));
            }
        }
        if t.quantisation == 0.0 && t.white == 0.0 && t.resolution == 0.0 {
            return Err(Error::bad_input(
                "a reading without any white noise, quantisation or resolution would be believed exactly: \
                 give the noise at least one of them",
            ));
        }
        if t.flicker > 0.0 {
            if self.flicker_rates.is_empty() {
                return Err(Error::bad_input(
                    "flicker noise needs at least one inverse correlation time",
                ));
            }
            let rising = self.flicker_rates.windows(2).all(|w| w[0] < w[1]);
            if !rising
                || self
                    .flicker_rates
                    .iter()
                    .any(|b| !(b.is_finite() && *b > 0.0))
            {
                return Err(Error::bad_input(
                    "the inverse correlation times of flicker noise must be positive and increasing",
                ));
            }
        }
        if t.gauss_markov > 0.0 && !(t.gauss_markov_rate.is_finite() && t.gauss_markov_rate > 0.0) {
            return Err(Error::bad_input(
                "a Gauss-Markov process needs a positive and finite correlation time",
            ));
        }
        if t.ramp > 0.0
            && !(self.ramp_frequency > 0.0
                && self.ramp_damping > 0.0
                && self.ramp_frequency.is_finite())
        {
            return Err(Error::bad_input(
                "the ramp's natural frequency and damping ratio must be positive",
            ));
        }
        Ok(())
    }

    /// Standard deviations of the Gauss-Markov processes that represent flicker.
    ///
    /// One process: the peak of its Allan variance equals the floor `(2 ln 2/π) B²`. Several, with rates in a geometric
    /// series of ratio ρ: `σ² = B² ln ρ/π` makes the sum of their spectra `B²/(2πf)` between the extreme rates; the
    /// first and the last also represent the spectrum beyond them ([`END_SHARE`]).
    fn flicker_sigmas(&self) -> Vec<f64> {
        let rates = &self.flicker_rates;
        let n = rates.len();
        let variance = |i: usize| {
            if n == 1 {
                return 2.0 * LN_2 / PI / GAUSS_MARKOV_PEAK;
            }
            let share = if i == 0 || i + 1 == n { END_SHARE } else { 1.0 };
            share * (rates[n - 1] / rates[0]).ln() / (n - 1) as f64 / PI
        };
        (0..n)
            .map(|i| self.terms.flicker * variance(i).sqrt())
            .collect()
    }

    /// The continuous system.
    ///
    /// # Errors
    /// When a coefficient is negative or not finite, or no term makes the readings uncertain.
    pub fn system(&self) -> Result<Shaping> {
        self.check()?;
        let t = &self.terms;
        let mut processes: Vec<(f64, f64)> = Vec::new();
        if t.flicker > 0.0 {
            let sigmas = self.flicker_sigmas();
            processes.extend(self.flicker_rates.iter().copied().zip(sigmas));
        }
        if t.gauss_markov > 0.0 {
            processes.push((t.gauss_markov_rate, t.gauss_markov));
        }
        let n = processes.len() + usize::from(t.walk > 0.0) + 2 * usize::from(t.ramp > 0.0);
        let mut f = DMatrix::zeros(n, n);
        let mut qc = DMatrix::zeros(n, n);
        let mut h = DVector::zeros(n);
        let mut p0 = DMatrix::zeros(n, n);
        for (i, (beta, sigma)) in processes.iter().enumerate() {
            f[(i, i)] = -beta;
            qc[(i, i)] = 2.0 * beta;
            h[i] = *sigma;
            p0[(i, i)] = 1.0;
        }
        let mut i = processes.len();
        if t.walk > 0.0 {
            // Starts at zero: U0 is the bias at the start, which could not be separated from a free initial state.
            qc[(i, i)] = 1.0;
            h[i] = t.walk;
            i += 1;
        }
        if t.ramp > 0.0 {
            // Intensity 4ζω₀ makes the stationary variance of the slope R²: the Allan variance is R²τ²/2 for τ ≪ 1/ω₀.
            f[(i, i + 1)] = 1.0;
            f[(i + 1, i)] = -self.ramp_frequency.powi(2);
            f[(i + 1, i + 1)] = -2.0 * self.ramp_damping * self.ramp_frequency;
            qc[(i + 1, i + 1)] = 4.0 * self.ramp_damping * self.ramp_frequency;
            h[i] = t.ramp;
            p0[(i + 1, i + 1)] = 1.0;
        }
        Ok(Shaping {
            f,
            qc,
            h,
            p0,
            averages: self.averages && n > 0,
            quantisation: t.quantisation,
        })
    }

    /// Variance of a reading over `pose_s` seconds that is white from pose to pose.
    #[must_use]
    pub fn white_variance(&self, pose_s: f64) -> f64 {
        let t = &self.terms;
        t.white * t.white / pose_s + undithered_variance(t.resolution, self.dither)
    }

    /// Variance of a reading without the slow terms: white, rounding, and the quantisation errors at both ends.
    #[must_use]
    pub fn fast_variance(&self, pose_s: f64) -> f64 {
        self.white_variance(pose_s) + 2.0 * (self.terms.quantisation / pose_s).powi(2)
    }
}

impl Shaping {
    /// Positions of the states.
    #[must_use]
    pub fn layout(&self) -> Layout {
        Layout {
            averages: self.averages,
            quantises: self.quantisation > 0.0,
            n_slow: self.h.len(),
        }
    }

    /// Covariance of the noise states before the first pose.
    #[must_use]
    pub fn start(&self) -> DMatrix<f64> {
        let layout = self.layout();
        let mut p = DMatrix::zeros(layout.n(), layout.n());
        let s = layout.first_slow();
        p.view_mut((s, s), (layout.n_slow, layout.n_slow))
            .copy_from(&self.p0);
        if layout.quantises {
            let e = usize::from(layout.averages);
            p[(e, e)] = 1.0;
        }
        p
    }

    /// Row of the measurement: how the reading of a pose depends on the noise states at its end.
    pub fn measurement_row(&self, pose_s: f64, h: &mut [f64]) {
        let layout = self.layout();
        h.fill(0.0);
        if layout.averages {
            h[0] = 1.0;
        } else {
            h[layout.first_slow()..].copy_from_slice(self.h.as_slice());
        }
        if layout.quantises {
            let q = usize::from(layout.averages);
            h[q] = self.quantisation / pose_s;
            h[q + 1] = -self.quantisation / pose_s;
        }
    }

    /// Transition over a pause of `gap` seconds and the pose of `pose_s` seconds after it, exactly.
    ///
    /// During the pose the running mean `m' = h·s / pose_s` starts from zero. With no pause the quantisation error at
    /// the start of this pose is the one at the end of the last: first differences, not independent errors.
    #[must_use]
    pub fn step(&self, gap: f64, pose_s: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let layout = self.layout();
        let (n, s, k) = (layout.n(), layout.first_slow(), layout.n_slow);
        let mut phi = DMatrix::zeros(n, n);
        let mut q = DMatrix::zeros(n, n);
        if layout.averages {
            let (phi_gap, q_gap) = discretise(&self.f, &self.qc, gap);
            let mut f = DMatrix::zeros(k + 1, k + 1);
            let mut qc = DMatrix::zeros(k + 1, k + 1);
            f.view_mut((0, 1), (1, k))
                .copy_from(&(self.h.transpose() / pose_s));
            f.view_mut((1, 1), (k, k)).copy_from(&self.f);
            qc.view_mut((1, 1), (k, k)).copy_from(&self.qc);
            let (phi_pose, q_pose) = discretise(&f, &qc, pose_s);
            let from_slow = phi_pose.columns(1, k).into_owned();
            let phi_both = &from_slow * phi_gap;
            let q_both = &from_slow * q_gap * from_slow.transpose() + q_pose;
            // Rows of the discrete system: the mean is state 0, the slow states start at `s`.
            let place = |i: usize| if i == 0 { 0 } else { s + i - 1 };
            for i in 0..=k {
                for j in 0..k {
                    phi[(place(i), s + j)] = phi_both[(i, j)];
                }
                for j in 0..=k {
                    q[(place(i), place(j))] = q_both[(i, j)];
                }
            }
        } else {
            let (phi_both, q_both) = discretise(&self.f, &self.qc, gap + pose_s);
            phi.view_mut((s, s), (k, k)).copy_from(&phi_both);
            q.view_mut((s, s), (k, k)).copy_from(&q_both);
        }
        if layout.quantises {
            let e = usize::from(layout.averages);
            q[(e, e)] = 1.0;
            // A pause shorter than a millionth of the pose is a rounding error of the clock.
            if gap <= 1e-6 * pose_s {
                phi[(e + 1, e)] = 1.0;
            } else {
                q[(e + 1, e + 1)] = 1.0;
            }
        }
        (phi, q)
    }

    /// Noise of the slow terms alone at the end of a pose, `h·s`, as a row over all noise states.
    #[must_use]
    pub fn slow_row(&self) -> DVector<f64> {
        let layout = self.layout();
        let mut row = DVector::zeros(layout.n());
        row.rows_mut(layout.first_slow(), layout.n_slow)
            .copy_from(&self.h);
        row
    }
}
