//! One bias of the gyro for a session whose poses differ (docs/model-session.md, 11.16).

use nalgebra::Vector3;

use super::fit::Fit;
use super::{Session, StaticMeans};

/// One bias for the session, raw and centred.
#[derive(Debug, Clone)]
pub struct SessionBias {
    /// Weight of every pose.
    pub weights: Vec<Vector3<f64>>,
    /// The bias.
    pub mean: Vector3<f64>,
    /// Its variance from differences between poses beyond their noise.
    pub variance: Vector3<f64>,
}

impl Fit {
    /// The session's one bias of the gyro: weights of the poses, raw mean, its variance from differences between poses
    /// beyond their noise (11.16).
    #[must_use]
    pub fn session_bias(&self, session: &Session) -> Option<SessionBias> {
        let rate = session.rate.as_ref()?;
        let (weights, spread) = pooled(rate, &self.read_biases(session, rate));
        let mut mean = Vector3::zeros();
        let mut variance = Vector3::zeros();
        for (w, z) in weights.iter().zip(&self.state.pose_rate_bias) {
            mean += w.component_mul(z);
            variance += w.component_mul(w).component_mul(&spread);
        }
        Some(SessionBias {
            weights,
            mean,
            variance,
        })
    }

    /// Raw mean of every pose less the Earth's rotation about the vertical and the effects there.
    fn read_biases(&self, session: &Session, rate: &StaticMeans) -> Vec<Vector3<f64>> {
        let effects = super::Distortion::at(
            self.distortion.rate.as_ref(),
            self.distortion.k,
            &self.state.effect,
        );
        let inverse = self.state.rate_scale.try_inverse();
        rate.mean
            .iter()
            .enumerate()
            .map(|(i, mean)| {
                let mut known = self.state.up[i] * session.earth_up;
                if let Some(effects) = &effects {
                    known += effects[i];
                }
                inverse.map_or(*mean, |inverse| mean - inverse * known)
            })
            .collect()
    }
}

/// A spread of the biases is significant when χ² exceeds its degrees of freedom by four of its standard deviations.
const BEYOND_CHANCE: f64 = 4.0;

/// Random-effects weights of biases and the variance between them (`DerSimonian` and Laird 1986), axis by axis.
fn pooled(rate: &StaticMeans, biases: &[Vector3<f64>]) -> (Vec<Vector3<f64>>, Vector3<f64>) {
    let n = biases.len();
    let mut weights = vec![Vector3::zeros(); n];
    let mut spread = Vector3::zeros();
    for axis in 0..3 {
        let precision: Vec<f64> = rate.sigma.iter().map(|s| s[axis].powi(-2)).collect();
        let total: f64 = precision.iter().sum();
        let mean = precision
            .iter()
            .zip(biases)
            .map(|(p, z)| p * z[axis])
            .sum::<f64>()
            / total;
        let chi2: f64 = precision
            .iter()
            .zip(biases)
            .map(|(p, z)| p * (z[axis] - mean).powi(2))
            .sum();
        let dof = n as f64 - 1.0;
        let squares: f64 = precision.iter().map(|p| p * p).sum();
        if chi2 > dof + BEYOND_CHANCE * (2.0 * dof.max(1.0)).sqrt() {
            spread[axis] = (chi2 - dof) / (total - squares / total).max(f64::MIN_POSITIVE);
        }
        let raw: Vec<f64> = rate
            .sigma
            .iter()
            .map(|s| 1.0 / (s[axis].powi(2) + spread[axis]))
            .collect();
        let sum: f64 = raw.iter().sum();
        for (w, value) in weights.iter_mut().zip(raw) {
            w[axis] = value / sum;
        }
    }
    (weights, spread)
}
