//! Bindings of the Allan variances.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods, ToPyArray,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

use crate::allan::along;
use crate::allan::degrees::{self, NoiseType};
use crate::allan::{self, Column, Curve, Kind, Stream};

pub(super) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<AllanKind>()?;
    module.add_class::<AllanStream>()?;
    module.add_class::<AllanNoise>()?;
    module.add_function(wrap_pyfunction!(allan_degrees, module)?)?;
    module.add_function(wrap_pyfunction!(allan_degrees_along, module)?)?;
    module.add_function(wrap_pyfunction!(allan_variance, module)?)?;
    Ok(())
}

/// Which variance of the family.
#[pyclass(eq, frozen, from_py_object, module = "trihedron._core")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AllanKind {
    Overlapping,
    NonOverlapping,
    Modified,
    Hadamard,
    Total,
}

impl From<AllanKind> for Kind {
    fn from(kind: AllanKind) -> Self {
        match kind {
            AllanKind::Overlapping => Self::Overlapping,
            AllanKind::NonOverlapping => Self::NonOverlapping,
            AllanKind::Modified => Self::Modified,
            AllanKind::Hadamard => Self::Hadamard,
            AllanKind::Total => Self::Total,
        }
    }
}

/// Type of noise at one averaging time.
#[pyclass(eq, frozen, from_py_object, module = "trihedron._core")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AllanNoise {
    Quantisation,
    White,
    Flicker,
    Walk,
}

impl From<AllanNoise> for NoiseType {
    fn from(noise: AllanNoise) -> Self {
        match noise {
            AllanNoise::Quantisation => Self::Quantisation,
            AllanNoise::White => Self::White,
            AllanNoise::Flicker => Self::Flicker,
            AllanNoise::Walk => Self::Walk,
        }
    }
}

/// Degrees of freedom of the variance of `n` readings in clusters of `m`.
#[pyfunction]
fn allan_degrees(
    py: Python<'_>,
    n: usize,
    m: usize,
    noise: AllanNoise,
    kind: AllanKind,
) -> PyResult<f64> {
    super::run(py, || {
        degrees::degrees_of_freedom(n, m, noise.into(), kind.into())
    })
}

/// Degrees of freedom of each variance of a curve, and its expectation over the Allan variance.
#[pyfunction]
fn allan_degrees_along(
    py: Python<'_>,
    n: usize,
    clusters: Vec<usize>,
    variance: Vec<f64>,
    weight: Vec<f64>,
    kind: AllanKind,
) -> PyResult<(Vec<f64>, Vec<f64>)> {
    super::run(py, || {
        along::along(n, &clusters, &variance, &weight, kind.into())
    })
}

/// Readings `(n, channels)` in the number type of the log: counts are read without a copy.
#[derive(FromPyObject)]
enum Readings<'py> {
    F64(PyReadonlyArray2<'py, f64>),
    F32(PyReadonlyArray2<'py, f32>),
    I16(PyReadonlyArray2<'py, i16>),
    I32(PyReadonlyArray2<'py, i32>),
}

/// A view that may cross threads: the readings in memory, row by row.
struct View<'a, T> {
    data: &'a [T],
    channels: usize,
}

impl<'a, T> View<'a, T> {
    fn channel(&self, channel: usize) -> Column<'a, T> {
        Column {
            data: self.data,
            channels: self.channels,
            channel,
        }
    }
}

fn view<'a, T: numpy::Element>(array: &'a PyReadonlyArray2<'_, T>) -> PyResult<View<'a, T>> {
    // `as_slice` accepts Fortran order too, which would be read down the columns.
    if !array.is_c_contiguous() {
        return Err(PyValueError::new_err(
            "readings must be C-contiguous, one row per sample",
        ));
    }
    let data = array
        .as_slice()
        .map_err(|_| PyValueError::new_err("readings must be C-contiguous, one row per sample"))?;
    Ok(View {
        data,
        channels: array.shape()[1],
    })
}

// The readings are borrowed, not owned: a copy would be the largest allocation of the whole computation.
macro_rules! with_view {
    ($readings:expr, $view:ident => $body:expr) => {
        match $readings {
            Readings::F64(array) => {
                let $view = view(array)?;
                $body
            }
            Readings::F32(array) => {
                let $view = view(array)?;
                $body
            }
            Readings::I16(array) => {
                let $view = view(array)?;
                $body
            }
            Readings::I32(array) => {
                let $view = view(array)?;
                $body
            }
        }
    };
}

fn readings<'py>(x: &Bound<'py, PyAny>) -> PyResult<Readings<'py>> {
    x.extract().map_err(|_| {
        PyTypeError::new_err(
            "readings must be an array (n, channels) of float64, float32, int16 or int32",
        )
    })
}

fn rows(x: &Readings<'_>) -> usize {
    match x {
        Readings::F64(array) => array.shape()[0],
        Readings::F32(array) => array.shape()[0],
        Readings::I16(array) => array.shape()[0],
        Readings::I32(array) => array.shape()[0],
    }
}

type Curves<'py> = (
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray2<f64>>,
);

fn curves<'py>(py: Python<'py>, found: &[Curve]) -> PyResult<Curves<'py>> {
    let size = [found.len(), found.first().map_or(0, |c| c.variance.len())];
    let flat =
        |pick: fn(&Curve) -> &Vec<f64>| found.iter().flat_map(pick).copied().collect::<Vec<f64>>();
    let terms: Vec<i64> = found
        .iter()
        .flat_map(|c| &c.terms)
        .map(|&t| i64::try_from(t).unwrap_or(i64::MAX))
        .collect();
    Ok((
        flat(|c| &c.variance).to_pyarray(py).reshape(size)?,
        terms.to_pyarray(py).reshape(size)?,
        flat(|c| &c.weight).to_pyarray(py).reshape(size)?,
    ))
}

#[pyfunction]
fn allan_variance<'py>(
    py: Python<'py>,
    x: &Bound<'py, PyAny>,
    clusters: Vec<usize>,
    kind: AllanKind,
) -> PyResult<Curves<'py>> {
    let x = readings(x)?;
    // NumPy requests large pages from the system, which halves the time: this is the largest allocation here.
    let workspace = PyArray1::<f64>::zeros(py, rows(&x) + 1, false);
    let mut workspace = workspace.try_readwrite()?;
    let workspace = workspace.as_slice_mut()?;
    let found = with_view!(&x, v => super::run_long(py, || {
        (0..v.channels)
            .map(|c| allan::variances_in(&v.channel(c), &clusters, kind.into(), workspace))
            .collect::<crate::Result<Vec<Curve>>>()
    }))?;
    curves(py, &found)
}

/// Overlapping Allan variance of a log that arrives in chunks `(n, channels)`.
#[pyclass(module = "trihedron._core")]
pub(crate) struct AllanStream {
    channels: Vec<Stream>,
}

#[pymethods]
impl AllanStream {
    /// Fewest running sums per channel that a stream needs.
    #[classattr]
    const LEAST_BUDGET: usize = 4 * allan::stream::FINE;

    #[new]
    fn new(py: Python<'_>, channels: usize, clusters: Vec<usize>, budget: usize) -> PyResult<Self> {
        let stream = super::run(py, || Stream::new(&clusters, budget))?;
        Ok(Self {
            channels: vec![stream; channels],
        })
    }

    fn extend(&mut self, py: Python<'_>, x: &Bound<'_, PyAny>) -> PyResult<()> {
        let x = readings(x)?;
        let channels = &mut self.channels;
        with_view!(&x, v => {
            if v.channels != channels.len() {
                return Err(PyValueError::new_err(format!(
                    "the stream has {} channels, this chunk {}", channels.len(), v.channels
                )));
            }
            super::run_long(py, || {
                channels.iter_mut().enumerate().try_for_each(|(c, stream)| stream.extend(&v.channel(c)))
            })
        })
    }

    /// `(clusters, variance, terms, stride, n, mean)`.
    #[allow(clippy::type_complexity)]
    fn finish<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(
        Vec<usize>,
        Bound<'py, PyArray2<f64>>,
        Bound<'py, PyArray2<i64>>,
        usize,
        usize,
        Vec<f64>,
    )> {
        let found = super::run(py, || {
            self.channels
                .iter()
                .map(Stream::finish)
                .collect::<crate::Result<Vec<_>>>()
        })?;
        let first = found
            .first()
            .ok_or_else(|| PyValueError::new_err("the stream has no channel"))?;
        let (clusters, stride, n) = (first.clusters.clone(), first.stride, first.n);
        let means = found.iter().map(|f| f.mean).collect();
        let found: Vec<Curve> = found.into_iter().map(|f| f.curve).collect();
        let (variance, terms, _) = curves(py, &found)?;
        Ok((clusters, variance, terms, stride, n, means))
    }

    /// Means `(k,)` of at least `readings` readings of one channel, and the number of readings in each.
    fn means<'py>(
        &self,
        py: Python<'py>,
        channel: usize,
        readings: usize,
    ) -> PyResult<(Bound<'py, PyArray1<f64>>, usize)> {
        let stream = self
            .channels
            .get(channel)
            .ok_or_else(|| PyValueError::new_err(format!("there is no channel {channel}")))?;
        let (means, size) = stream.means(readings);
        Ok((means.to_pyarray(py), size))
    }
}
