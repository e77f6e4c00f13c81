//! Starting points of the norm fit.

use nalgebra::{Matrix3, Vector3};

use super::Model;
use crate::ellipsoid::{self, Standardisation};
use crate::error::{Error, Result};

/// Standardised readings.
pub(super) struct Starts {
    u: Vec<Vector3<f64>>,
    pub(super) standard: Standardisation,
}

impl Starts {
    /// Starting points from these readings.
    ///
    /// # Errors
    /// When all readings are the same.
    pub(super) fn of(values: &[Vector3<f64>]) -> Result<Self> {
        let standard = Standardisation::of(values)?;
        let u = values.iter().map(|a| standard.apply(a)).collect();
        Ok(Self { u, standard })
    }

    fn none(&self) -> Error {
        Error::not_determined(format!(
            "the static poses give no starting point: {}",
            ellipsoid::missing_directions(&self.u)
        ))
    }

    /// The sphere through the readings: equal scales, square axes.
    ///
    /// # Errors
    /// When there is none.
    pub(super) fn sphere(&self, gravity: f64) -> Result<Model> {
        self.unit_sphere(gravity)
            .map(|model| self.standard.undo(&model))
    }

    fn unit_sphere(&self, gravity: f64) -> Result<Model> {
        let (centre, radius) = ellipsoid::fit_sphere(&self.u).ok_or_else(|| self.none())?;
        let s = Matrix3::identity() * (gravity / radius);
        Ok(Model { s, b: -s * centre })
    }

    /// The ellipsoid, or the sphere where the poses do not determine one; whichever explains the readings better.
    ///
    /// # Errors
    /// When there is neither.
    pub(super) fn best(&self, gravity: f64) -> Result<Model> {
        let model_of = |quadric: Result<ellipsoid::Quadric>| quadric.ok()?.model(gravity);
        let ellipsoid = model_of(ellipsoid::fit_quadric(&self.u))
            .or_else(|| model_of(ellipsoid::fit_ellipsoid(&self.u)));
        let misfit = |model: &Model| -> f64 {
            let square = |u| (model.correct(u).norm() - gravity).powi(2);
            self.u.iter().map(square).sum()
        };
        ellipsoid
            .into_iter()
            .chain([self.unit_sphere(gravity)?])
            .map(|model| (misfit(&model), model))
            .filter(|(misfit, model)| misfit.is_finite() && model.s.determinant().abs() > 0.0)
            .min_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, model)| self.standard.undo(&model))
            .ok_or_else(|| self.none())
    }
}
