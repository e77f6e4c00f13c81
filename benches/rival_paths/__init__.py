"""The hot paths, one file each: data, our function, NumPy and SciPy, what PyPI offers."""
