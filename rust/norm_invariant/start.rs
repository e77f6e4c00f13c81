//! Starting points of the norm fit.

use nalgebra::{Matrix3, Vector3};

use super::{Model, N_PARAMETERS, Readings, Settings};
use crate::ellipsoid::{self, Moments, Standardisation};
use crate::error::{Error, Result};

/// The readings, or an even share of them that shows the same poses.
pub(super) enum Share<'a> {
    /// All readings, where there are few.
    All(&'a [Vector3<f64>]),
    /// A share of many readings.
    Some {
        values: Vec<Vector3<f64>>,
        noise: &'a [Matrix3<f64>],
        pose: Vec<usize>,
    },
}

/// At most `most` of the readings.
pub(super) fn even_share(readings: Readings<'_>, most: usize) -> Share<'_> {
    let n = readings.values.len();
    let stride = n.div_ceil(most);
    if stride == 1 {
        return Share::All(readings.values);
    }
    // One of each stretch, at a position that varies: a fixed stride could coincide with the poses.
    let chosen = (0..n.div_ceil(stride)).map(|k| {
        let size = stride.min(n - k * stride);
        k * stride + (k * 7919) % size
    });
    let is_common = readings.noise.len() == 1;
    Share::Some {
        values: chosen.clone().map(|i| readings.values[i]).collect(),
        pose: chosen
            .map(|i| {
                if is_common {
                    0
                } else {
                    readings.pose.get(i).copied().unwrap_or(i)
                }
            })
            .collect(),
        noise: readings.noise,
    }
}

impl Share<'_> {
    pub(super) fn values(&self) -> &[Vector3<f64>] {
        match self {
            Self::All(values) => values,
            Self::Some { values, .. } => values,
        }
    }
}

/// Root mean square residual of norms, in |g|, below which an ellipsoid is the start without any comparison.
const CLOSE: f64 = 1e-2;

/// Readings, standardised, and the sums of their products.
pub(super) struct Starts<'a> {
    values: &'a [Vector3<f64>],
    pub(super) standard: Standardisation,
    moments: Moments,
}

impl<'a> Starts<'a> {
    /// Starting points from these readings.
    ///
    /// # Errors
    /// When all readings are the same.
    pub(super) fn of(values: &'a [Vector3<f64>]) -> Result<Self> {
        let standard = Standardisation::of(values)?;
        Ok(Self {
            values,
            standard,
            moments: Moments::of(values, &standard),
        })
    }

    fn standardised(&self) -> Vec<Vector3<f64>> {
        self.values.iter().map(|a| self.standard.apply(a)).collect()
    }

    fn none(&self) -> Error {
        Error::not_determined(format!(
            "the static poses give no starting point: {}",
            ellipsoid::missing_directions(&self.standardised())
        ))
    }

    /// The sphere through the readings: equal scales, square axes.
    ///
    /// # Errors
    /// When there is none.
    pub(super) fn sphere(&self, settings: &Settings) -> Result<Model> {
        self.unit_sphere(settings)
            .map(|model| self.standard.undo(&model))
    }

    fn unit_sphere(&self, settings: &Settings) -> Result<Model> {
        let (centre, radius) = self
            .moments
            .sphere()
            .or_else(|| ellipsoid::fit_sphere(&self.standardised()))
            .ok_or_else(|| self.none())?;
        let s = Matrix3::identity() * (settings.gravity / radius);
        Ok(Model { s, b: -s * centre })
    }

    /// The ellipsoid, or the sphere where the poses do not determine one; whichever explains the readings better.
    ///
    /// # Errors
    /// When there is neither.
    pub(super) fn best(&self, settings: &Settings) -> Result<Model> {
        let g = settings.gravity;
        let mut candidates = Vec::with_capacity(2);
        if let Some(model) = self
            .moments
            .quadric()
            .and_then(|quadric| quadric.model(g, settings.frame))
        {
            candidates.push(model);
        } else {
            let u = self.standardised();
            candidates.extend(
                ellipsoid::fit_quadric(&u)
                    .ok()
                    .and_then(|quadric| quadric.model(g, settings.frame)),
            );
            if candidates.is_empty()
                && u.len() >= N_PARAMETERS
                && let Ok(quadric) = ellipsoid::fit_ellipsoid(&u)
            {
                candidates.extend(quadric.model(g, settings.frame));
            }
        }
        let n = self.values.len() as f64;
        let misfit = |model: &Model| {
            let square = |a| (model.correct(&self.standard.apply(a)).norm() - g).powi(2);
            self.values.iter().map(square).sum::<f64>()
        };
        // An ellipsoid through the readings needs no comparison with a sphere.
        if let [model] = candidates.as_slice()
            && misfit(model) < (CLOSE * g).powi(2) * n
        {
            return Ok(self.standard.undo(model));
        }
        candidates.push(self.unit_sphere(settings)?);
        candidates
            .into_iter()
            .map(|model| (misfit(&model), model))
            .filter(|(misfit, model)| misfit.is_finite() && model.s.determinant().abs() > 0.0)
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, model)| self.standard.undo(&model))
            .ok_or_else(|| self.none())
    }
}
