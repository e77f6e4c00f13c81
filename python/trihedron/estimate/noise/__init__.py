"""NOISE: Allan curves at memory speed; which noise terms a static log holds, how large, with what certainty."""

from trihedron.channel_facts.low_pass import gain_of
from trihedron.channel_facts.pooled import ratio_of
from trihedron.estimate.noise.allan import allan_deviation, default_clusters, stream_allan_deviation
from trihedron.estimate.noise.degrees import degrees_of_freedom
from trihedron.estimate.noise.from_curve import identify_curve
from trihedron.estimate.noise.identify import identify_noise
from trihedron.estimate.noise.planning import recording_length_s, relative_sigma
from trihedron.estimate.noise.poses import noise_of_poses
from trihedron.estimate.noise.streamed import stream_noise

__all__ = [
    "allan_deviation",
    "default_clusters",
    "degrees_of_freedom",
    "gain_of",
    "identify_curve",
    "identify_noise",
    "noise_of_poses",
    "ratio_of",
    "recording_length_s",
    "relative_sigma",
    "stream_allan_deviation",
    "stream_noise",
]
