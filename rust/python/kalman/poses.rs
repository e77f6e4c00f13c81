//! Arrays of readings, references and times as poses.

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::kalman::axis::Pose;
use crate::python::arrays::rows3;

/// Poses of one axis: readings, references (g in the frame of the axes), times, variance beyond the model's.
#[pyclass(module = "trihedron._core", frozen)]
pub(super) struct KalmanPoses {
    pub(super) poses: Vec<Pose>,
}

#[pymethods]
impl KalmanPoses {
    #[new]
    fn new(
        readings: PyReadonlyArray1<'_, f64>,
        references: PyReadonlyArray2<'_, f64>,
        start_s: PyReadonlyArray1<'_, f64>,
        pose_s: PyReadonlyArray1<'_, f64>,
        extra_variance: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Self> {
        let rows = rows3("references", &references)?;
        let n = rows.len();
        for (name, array) in [
            ("readings", &readings),
            ("start_s", &start_s),
            ("pose_s", &pose_s),
            ("extra_variance", &extra_variance),
        ] {
            if array.len() != n {
                return Err(PyValueError::new_err(format!(
                    "{name} must have shape ({n},) like the references, got ({},)",
                    array.len()
                )));
            }
        }
        let (z, t, pose_s, extra) = (
            readings.as_array(),
            start_s.as_array(),
            pose_s.as_array(),
            extra_variance.as_array(),
        );
        let poses = (0..n)
            .map(|i| Pose {
                reading: z[i],
                reference: rows[i].into(),
                start: t[i],
                pose_s: pose_s[i],
                extra_variance: extra[i],
            })
            .collect();
        Ok(Self { poses })
    }
}
