//! Bindings for a gyro beside a reference motion.

use nalgebra::{DMatrix, Dyn, Matrix3, OMatrix, U3};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadonlyArray3, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::prelude::*;

use super::arrays::{
    as_vectors, dmatrix, flat1, flat2, flat3, matrices3, matrix, matrix3, of3, stack3, vectors,
};
use crate::reference_motion::{Block, Log, Strengths, Truth, blocks, normal, smoothed};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<ReferenceLog>()?;
    module.add_class::<ReferenceBlocks>()?;
    module.add_class::<ReferenceNormal>()
}

/// A log at even times: its first time and step, validity of samples, the signals `(n, q)` to be integrated, and the
/// directions `(3, 3)` of the gyro's axes in columns.
#[pyclass(frozen, module = "trihedron._core")]
struct ReferenceLog {
    start_s: f64,
    step_s: f64,
    is_valid: Vec<bool>,
    signals: Vec<f64>,
    n_signals: usize,
    axes: Matrix3<f64>,
}

#[pymethods]
impl ReferenceLog {
    #[new]
    fn new(
        start_s: f64,
        step_s: f64,
        is_valid: PyReadonlyArray1<'_, bool>,
        signals: PyReadonlyArray2<'_, f64>,
        axes: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        Ok(Self {
            start_s,
            step_s,
            is_valid: flat1(&is_valid).into_owned(),
            signals: flat2(&signals).into_owned(),
            n_signals: signals.shape()[1],
            axes: matrix3("axes", &axes)?,
        })
    }

    /// Blocks of `block` samples of the corrected `rate` `(n, 3)` against attitudes `(m, 3, 3)` at log times `(m,)`.
    fn blocks(
        &self,
        py: Python<'_>,
        rate: PyReadonlyArray2<'_, f64>,
        time_s: PyReadonlyArray1<'_, f64>,
        attitude: PyReadonlyArray3<'_, f64>,
        block: usize,
    ) -> PyResult<ReferenceBlocks> {
        let (rate, time_s) = (flat3("rate", &rate)?, flat1(&time_s));
        let attitude = matrices3("attitude", &attitude)?;
        let found = super::run(py, || {
            let log = Log {
                start_s: self.start_s,
                step_s: self.step_s,
                rate: as_vectors(&rate),
                is_valid: &self.is_valid,
                signals: &self.signals,
                n_signals: self.n_signals,
                axes: self.axes,
            };
            let truth = Truth {
                time_s: &time_s,
                attitude: &attitude,
            };
            blocks(&log, &truth, block)
        })?;
        Ok(ReferenceBlocks(found))
    }
}

/// A log cut into blocks beside a reference.
#[pyclass(frozen, module = "trihedron._core")]
struct ReferenceBlocks(Vec<Block>);

fn named(of: [f64; 8]) -> Strengths {
    Strengths {
        angle_walk: of[0],
        scale_noise: of[1],
        bias_walk: of[2],
        white: of[3],
        world: [of[4], of[5]],
        body: [of[6], of[7]],
    }
}

fn columns_of(rows: &OMatrix<f64, U3, Dyn>) -> DMatrix<f64> {
    DMatrix::from_fn(3, rows.ncols(), |i, j| rows[(i, j)])
}

/// Normal equations: `gram` `(p, p)`, `log_det` of the covariance of `rows` observations of three; standardised
/// `innovations` `(3 m, p)`; the mean over time of the bias walk `(3, p)` by columns, and its covariance `(3, 3)`.
#[pyclass(frozen, get_all, module = "trihedron._core")]
struct ReferenceNormal {
    gram: Py<PyArray2<f64>>,
    log_det: f64,
    rows: usize,
    innovations: Py<PyArray2<f64>>,
    mean_bias: Py<PyArray2<f64>>,
    cov_mean_bias: Py<PyArray2<f64>>,
}

#[pymethods]
impl ReferenceBlocks {
    /// The blocks with those excluded where `lost` `(m,)`: their rows are not used, and the attitude begins anew.
    fn without(&self, lost: PyReadonlyArray1<'_, bool>) -> Self {
        let mut blocks = self.0.clone();
        for (block, _) in blocks
            .iter_mut()
            .zip(flat1(&lost).iter())
            .filter(|(_, l)| **l)
        {
            block.rows = [0, block.rows[0] + block.rows[1]];
            block.is_lost = true;
        }
        Self(blocks)
    }

    /// `(m,)` mean times of the reference's rows in each block, s.
    fn time_s<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.0
            .iter()
            .map(|b| b.time_s)
            .collect::<Vec<_>>()
            .to_pyarray(py)
    }

    /// `(m, 2)` numbers of the reference's rows used, and excluded as outliers.
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<usize>>> {
        let flat: Vec<usize> = self.0.iter().flat_map(|b| b.rows).collect();
        flat.to_pyarray(py).reshape([self.0.len(), 2])
    }

    /// `(m, 3)` rotation from the gyro's attitude to the reference's, in the world, rad.
    fn angle<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.0.iter().map(|b| b.angle).collect::<Vec<_>>())
    }

    /// `(m, 3)` mean rate in the world, and `(m, 3)` mean of the rate times the time from the log's middle.
    #[allow(clippy::type_complexity, reason = "a pair of arrays")]
    fn wrt_clock<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
        let of = |k: usize| {
            vectors(
                py,
                &self.0.iter().map(|b| b.wrt_clock[k]).collect::<Vec<_>>(),
            )
        };
        Ok((of(0)?, of(1)?))
    }

    /// `(m, 3, 3)` mean attitudes.
    fn attitude<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        stack3(py, self.0.iter().map(|b| b.attitude))
    }

    /// `(m, 9, q)` means of `∫ C_ai s_j dt`, row 3 a + i.
    fn moments<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let q = self.0.first().map_or(0, |b| b.moments.ncols());
        let flat: Vec<f64> = self
            .0
            .iter()
            .flat_map(|b| b.moments.transpose().as_slice().to_vec())
            .collect();
        flat.to_pyarray(py).reshape([self.0.len(), 9, q])
    }

    /// Normal equations of columns `(3 m, p)`.
    fn normal<'py>(
        &self,
        py: Python<'py>,
        columns: PyReadonlyArray2<'py, f64>,
        strengths: [f64; 8],
    ) -> PyResult<ReferenceNormal> {
        let columns = dmatrix(&columns);
        let found = super::run(py, || normal(&self.0, &columns, &named(strengths)))?;
        Ok(ReferenceNormal {
            gram: matrix(py, &found.gram)?.unbind(),
            log_det: found.log_det,
            rows: found.rows,
            innovations: matrix(py, &found.innovations)?.unbind(),
            mean_bias: matrix(py, &columns_of(&found.mean_bias))?.unbind(),
            cov_mean_bias: of3(py, &found.cov_mean_bias)?.unbind(),
        })
    }

    /// The bias walk as a combination `(3 m, p)` of the columns, its covariance `(m, 3, 3)`, and the reference's slow
    /// errors of world and body as such combinations.
    #[allow(clippy::type_complexity, reason = "four arrays")]
    fn smoothed<'py>(
        &self,
        py: Python<'py>,
        columns: PyReadonlyArray2<'py, f64>,
        strengths: [f64; 8],
    ) -> PyResult<(
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray3<f64>>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<f64>>,
    )> {
        let columns = dmatrix(&columns);
        let found = super::run(py, || smoothed(&self.0, &columns, &named(strengths)))?;
        Ok((
            matrix(py, &found.bias)?,
            stack3(py, found.bias_cov.into_iter())?,
            matrix(py, &found.slow[0])?,
            matrix(py, &found.slow[1])?,
        ))
    }
}
