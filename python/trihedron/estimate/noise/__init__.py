"""NOISE: Allan curves at memory speed; which noise terms a static log holds, how large, with what certainty."""
