"""Segments of a simulated recording from its truth, so that a calibration is tested apart from the segmentation."""

import numpy as np

from trihedron.records import Move, Pose, Segments


def segments_from_truth(recording, truth, trim_s=0.05):
    """Poses as they were made, edges trimmed, means with the standard error of white noise."""
    trim = max(1, round(trim_s * recording.rate_hz))
    poses, edges = [], []
    for segment in truth.segments:
        if segment.kind == "pose" and segment.stop - segment.start > 3 * trim:
            poses.append(Pose(len(poses), segment.start + trim, segment.stop - trim, segment.start, segment.stop))
            edges.append((segment.start + trim, segment.stop - trim))
    moves = tuple(Move(i, i, i + 1, edges[i][1], edges[i + 1][0]) for i in range(len(edges) - 1))
    counts = np.array([b - a for a, b in edges])

    def statistics(readings):
        if readings is None:
            return None, None, None
        blocks = [readings[a:b] for a, b in edges]
        mean = np.array([block.mean(axis=0) for block in blocks])
        sigma = np.sqrt(
            sum(((block - m) ** 2).sum(axis=0) for block, m in zip(blocks, mean, strict=True))
            / (counts.sum() - len(counts))
        )
        return sigma, mean, sigma / np.sqrt(counts)[:, None]

    sigma_a, mean_a, error_a = statistics(recording.accelerometer)
    sigma_g, mean_g, error_g = statistics(recording.gyroscope)
    middle = np.array([0.5 * (recording.time_s[a] + recording.time_s[b - 1]) for a, b in edges])
    return Segments(
        poses=tuple(poses),
        moves=moves,
        accelerometer_sigma=sigma_a,
        gyroscope_sigma=sigma_g,
        accelerometer_mean=mean_a,
        gyroscope_mean=mean_g,
        accelerometer_sigma_mean=error_a,
        gyroscope_sigma_mean=error_g,
        n_averaged=counts,
        time_mid_s=middle,
        duration_s=counts / recording.rate_hz,
    )


def codes(findings):
    """Codes of findings, or of those of a result."""
    return {finding.code for finding in getattr(findings, "findings", findings)}


def z_scores(found, truth):
    error = np.concatenate([(found.S - truth.gyroscope_S).ravel(), found.b - truth.gyroscope_b])
    return error / np.sqrt(np.diag(found.covariance))
