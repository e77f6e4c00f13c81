//! The solver's nine parameters and the model that they represent.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::{Model, N_PARAMETERS, Parameters};
use crate::ellipsoid::{self, Standardisation};
use crate::error::{Error, Result};
use crate::sensor_model::LOWER;

/// The model with the same norms and a lower triangular `S`.
///
/// # Errors
/// When `S` is singular.
pub(super) fn lower(model: &Model) -> Result<Model> {
    let singular = || Error::bad_input("the starting S is singular");
    let s = ellipsoid::reversed_cholesky(&(model.s.transpose() * model.s)).ok_or_else(singular)?;
    let inverse = model.s.try_inverse().ok_or_else(singular)?;
    Ok(Model {
        s,
        b: s * inverse * model.b,
    })
}

/// Solver's parameters: six entries of `S · size`, then `d = b + S centre`, so that columns are of one size.
pub(super) fn pack(model: &Model, standard: &Standardisation) -> Parameters {
    let s = model.s * standard.size;
    let d = model.b + model.s * standard.centre;
    let mut theta = Parameters::zeros();
    for (k, &(i, j)) in LOWER.iter().enumerate() {
        theta[k] = s[(i, j)];
    }
    theta.fixed_rows_mut::<3>(6).copy_from(&d);
    theta
}

/// `S` and `d` in standardised readings.
pub(super) fn unpack_standardised(theta: &[f64]) -> Model {
    let mut s = Matrix3::zeros();
    for (k, &(i, j)) in LOWER.iter().enumerate() {
        s[(i, j)] = theta[k];
    }
    Model {
        s,
        b: Vector3::new(theta[6], theta[7], theta[8]),
    }
}

pub(super) fn unpack(theta: &[f64], standard: &Standardisation) -> Model {
    standard.undo(&unpack_standardised(theta))
}

/// `∂(S row by row, b)/∂θ`: linear, because `b = d - S centre`.
pub(super) fn map_to_entries(standard: &Standardisation) -> SMatrix<f64, 12, N_PARAMETERS> {
    let mut map = SMatrix::zeros();
    for (k, &(row, column)) in LOWER.iter().enumerate() {
        map[(3 * row + column, k)] = 1.0 / standard.size;
        map[(9 + row, k)] = -standard.centre[column] / standard.size;
    }
    for i in 0..3 {
        map[(9 + i, 6 + i)] = 1.0;
    }
    map
}
