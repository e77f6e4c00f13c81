//! Sums of numbers that are known by their logarithms.

/// Logarithm of a sum, from the logarithms of its terms.
pub fn log_sum<I: Iterator<Item = f64> + Clone>(
    terms: impl IntoIterator<Item = f64, IntoIter = I>,
) -> f64 {
    let terms = terms.into_iter();
    let most = terms.clone().fold(f64::NEG_INFINITY, f64::max);
    most + terms.map(|term| (term - most).exp()).sum::<f64>().ln()
}
