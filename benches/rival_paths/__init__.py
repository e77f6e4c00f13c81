"""The hot paths, one file each: data, our function, NumPy and SciPy, numba, what PyPI offers, tuned C where it is."""
