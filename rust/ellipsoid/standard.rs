//! Readings centred on their mean and scaled to unit size.

use nalgebra::Vector3;

use crate::error::{Error, Result};
use crate::sensor_model::Model;

/// Centre and scale of readings: `a' = centre + size · u`.
#[derive(Debug, Clone, Copy)]
pub struct Standardisation {
    /// Mean reading.
    pub centre: Vector3<f64>,
    /// Root mean square distance from it.
    pub size: f64,
}

impl Standardisation {
    /// Standardisation of the given readings.
    ///
    /// # Errors
    /// When all readings are the same, or one is missing, infinite or beyond any sensor.
    pub fn of(readings: &[Vector3<f64>]) -> Result<Self> {
        let n = readings.len().max(1) as f64;
        let centre = readings.iter().sum::<Vector3<f64>>() / n;
        let from_centre = readings.iter().map(|a| (a - centre).norm_squared());
        let size = (from_centre.sum::<f64>() / n).sqrt();
        if !size.is_finite() {
            return Err(Error::bad_input(
                "the readings hold numbers that are missing, infinite or too large for any sensor",
            ));
        }
        if size <= 1e-12 * (1.0 + centre.norm()) {
            return Err(Error::not_determined(
                "all static poses read the same: turn the sensor into different orientations between poses",
            ));
        }
        Ok(Self { centre, size })
    }

    /// The standardised reading `u`.
    #[must_use]
    pub fn apply(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        (reading - self.centre) / self.size
    }

    /// The model of raw readings for a model of standardised ones.
    #[must_use]
    pub fn undo(&self, model: &Model) -> Model {
        let s = model.s / self.size;
        Model {
            s,
            b: model.b - s * self.centre,
        }
    }
}
