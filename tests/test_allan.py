"""Allan curves: published values, counterparts, an independent tool, precision, gaps, streams; its command."""

import csv
import io
import json
from contextlib import redirect_stdout
from dataclasses import replace

import allantools
import numpy as np
import pytest
from scipy.stats import chi2

import trihedron
from noise_coverage import in_time
from small_session import rejected
from test_export import given
from trihedron import _core
from trihedron.api.identifying import allan as noise_of
from trihedron.cli import main
from trihedron.estimate.noise.allan import KINDS, allan_deviation
from trihedron.estimate.noise.streamed import stream_noise
from trihedron.records import Recording
from trihedron.report.noise import noise_report
from trihedron.report.noise_files import curve_csv
from trihedron.units import AccelerationUnit, RateUnit

RATE = 50.0
NOISE = _core.AllanNoise
TYPES = {2: NOISE.Quantisation, 0: NOISE.White, -1: NOISE.Flicker, -2: NOISE.Walk}
NINE = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0]


def by_definition(x, m, d):
    """Sums of ``d`` times neighbouring means over the readings present, squared; weight Σd² / (m Σ(d²/n))."""
    total = weight = 0.0
    for k in range(len(x) - len(d) * m + 1):
        parts = [x[k + i * m : k + (i + 1) * m] for i in range(len(d))]
        parts = [part[np.isfinite(part)] for part in parts]
        if all(map(len, parts)):
            w = d @ d / (m * np.sum(d**2 / list(map(len, parts))))
            total += w * (d @ [part.mean() for part in parts]) ** 2
            weight += w
    return total / (d @ d * weight)


# NIST SP 1065 (2008), tables 30 and 31, as printed: seven digits.
@pytest.mark.parametrize(
    ("kind", "m", "value"),
    [
        ("overlapping", 1, 91.22945),
        ("non-overlapping", 2, 115.8082),
        ("overlapping", 2, 85.95287),
        ("modified", 2, 74.78849),
        ("total", 1, 91.22945),
        ("total", 2, 93.90379),
        ("hadamard", 1, 70.80607),
        ("hadamard", 2, 85.61487),
    ],
)
def test_the_nine_nbs_frequencies_give_the_printed_values(kind, m, value):
    assert allan_deviation(NINE, 1.0, [m], kind).deviation[0] == pytest.approx(value, abs=6e-5)


@pytest.mark.parametrize(
    ("kind", "oracle"),
    [
        ("overlapping", allantools.oadev),
        ("non-overlapping", allantools.adev),
        ("modified", allantools.mdev),
        ("hadamard", allantools.ohdev),
        ("total", allantools.totdev),
    ],
)
def test_every_kind_agrees_with_allantools(kind, oracle):
    rng = np.random.default_rng(11)
    x = rng.normal(size=20000) + 0.01 * np.cumsum(rng.normal(size=20000))
    clusters = [1, 2, 3, 7, 10, 33, 100, 511, 1000, 3000, 6000]
    curve = allan_deviation(x, 50.0, clusters, kind)
    taus, deviation, _, n_terms = oracle(x, rate=50.0, data_type="freq", taus=curve.tau_s)
    assert len(taus) == len(clusters)
    if kind == "overlapping":
        assert curve.n_terms.tolist() == n_terms.tolist()
    # 95 % of a χ² with the curve's own degrees of freedom; a total variance has a bias besides.
    lower = curve.variance * curve.edf / chi2.ppf(0.975, curve.edf)
    assert kind == "total" or curve.lower**2 == pytest.approx(lower, rel=1e-9)
    # The oracle keeps the mean in its running sum: 1e-10 leaves room for its rounding, ours is far below.
    assert curve.deviation == pytest.approx(deviation, rel=1e-10)


def test_a_bias_of_ten_thousand_times_the_noise_costs_no_digits():
    rng = np.random.default_rng(4)
    x = 1e4 + rng.normal(size=1_000_000)
    clusters = [1, 10, 1000, 30000, 400000]
    curve = allan_deviation(x, 100.0, clusters)
    # By a running sum in extended precision, the mean removed first.
    wide = x.astype(np.longdouble)
    p = np.concatenate([[0], np.cumsum(wide - wide.mean())])
    for m, variance in zip(clusters, curve.variance, strict=True):
        d = p[2 * m :] - 2 * p[m:-m] + p[: -2 * m]
        assert variance == pytest.approx(float(np.sum(d * d) / (2 * np.longdouble(m) ** 2 * len(d))), rel=1e-9)
    # Nor where readings are missing.
    x[::1000] = np.nan
    variances = (allan_deviation(one, 100.0, clusters).variance for one in (x, x - 1e4))
    assert next(variances) == pytest.approx(next(variances), rel=1e-9)


def test_counts_are_read_in_their_own_type():
    counts = np.random.default_rng(5).integers(-3000, 3000, size=(5000, 3))
    wide = allan_deviation(counts.astype(np.float64), 100.0)
    for kind in (np.int16, np.int32, np.int64, np.float32):
        assert np.allclose(allan_deviation(counts.astype(kind), 100.0).deviation, wide.deviation, rtol=1e-13)


def test_missing_readings_are_weighted_as_defined():
    rng = np.random.default_rng(6)
    x = rng.normal(size=400).cumsum()
    x[rng.random(400) < 0.1] = np.nan
    x[200:260] = np.nan
    column = x[:, np.newaxis]
    kinds = _core.AllanKind.Overlapping, _core.AllanKind.Hadamard
    for m in (1, 5, 40, 120):
        for kind, signs in zip(kinds, (np.array([-1.0, 1.0]), np.array([1.0, -2.0, 1.0])), strict=True):
            weighted = by_definition(x, m, signs)
            found = _core.allan_variance(column, [m], kind)[0]
            assert found[0, 0] == pytest.approx(weighted * complete_share(x, m, signs**2, weighted), rel=1e-11)


def complete_share(x, m, factors, weighted):
    """Variance of complete clusters over the ``weighted`` one, of one length m: the scatter of means of some of the
    readings of a cluster about that of all of them is subtracted, (1/c - 1/m) s²."""
    starts = np.arange(len(x) - len(factors) * m + 1)[:, None, None]
    clusters = x[starts + m * np.arange(len(factors))[:, None] + np.arange(m)]
    count = np.isfinite(clusters).sum(axis=2)
    clusters, count = clusters[count.all(axis=1)], count[count.all(axis=1)]
    if m == 1:
        return 1.0
    within = np.nansum((clusters - np.nanmean(clusters, axis=2, keepdims=True)) ** 2) / np.sum(count - 1)
    inverse = 1.0 / np.mean(1.0 / np.sum(factors / count, axis=1))
    excess = within * (inverse / np.sum(factors) - 1.0 / m)
    # White noise alone has as much in any case.
    return max(1.0 - excess / weighted, np.sum(factors) / m / inverse)


@pytest.mark.parametrize("kind", ["overlapping", "non-overlapping", "hadamard"])
def test_readings_lost_here_and_there_bias_neither_white_noise_nor_a_random_walk(kind):
    share = 0.3
    rng = np.random.default_rng(9)
    clusters = [1, 2, 5, 20, 100, 500]
    for make in (lambda: rng.normal(size=20_000), lambda: 0.02 * np.cumsum(rng.normal(size=20_000))):
        ratio = []
        for _ in range(12):
            x = make()
            whole = allan_deviation(x, 1.0, clusters, kind).variance
            x[rng.random(len(x)) < share] = np.nan
            ratio.append(allan_deviation(x, 1.0, clusters, kind).variance / whole)
        error = np.std(ratio, axis=0, ddof=1) / 5.0
        # Against the same readings with none lost: before, 1/(1 - share) for white noise.
        assert np.all(np.abs(np.mean(ratio, axis=0) - 1.0) < 4.5 * error + 0.02), (np.mean(ratio, axis=0), error)


def test_a_stream_beyond_its_memory_thins_only_the_long_clusters():
    x = np.random.default_rng(9).normal(size=1_500_000)
    clusters = [1, 100, 65536, 100_000, 300_000]
    streamed = stream_noise([x[:, None]], 100.0, clusters=clusters, budget_bytes=8 << 18).curve
    whole = allan_deviation(x[:, np.newaxis], 100.0, streamed.clusters)
    assert streamed.stride == 8
    assert streamed.deviation[:3] == pytest.approx(whole.deviation[:3], rel=1e-11)
    assert streamed.edf == pytest.approx(whole.edf, rel=1e-2)
    # Every eighth start of 1e5: the information is the same, the sum is not.
    assert streamed.deviation == pytest.approx(whole.deviation, rel=1e-3)


@pytest.mark.parametrize("kind", ["overlapping", "non-overlapping", "modified", "hadamard"])
@pytest.mark.parametrize("alpha", [2, 0, -1, -2])
def test_degrees_of_freedom_agree_with_an_independent_implementation(kind, alpha):
    # White noise and a walk of *readings* are exact at every cluster; the oracle's averaged phase joins them at many.
    is_exact = alpha in (0, -2) and kind != "modified"
    for m in (64, 1024) if is_exact else (1, 4, 64, 1024):
        oracle = allantools.edf_greenhall(
            alpha=alpha,
            d=3 if kind == "hadamard" else 2,
            m=m,
            N=10001,
            overlapping=kind != "non-overlapping",
            modified=kind == "modified",
            verbose=False,
        )
        # The oracle's closed approximations for long sums are good to 2 %; ours are the sums themselves.
        assert _core.allan_degrees(10000, m, TYPES[alpha], KINDS[kind]) == pytest.approx(oracle, rel=0.02)


@pytest.mark.parametrize("alpha", [2, 0, -2])
@pytest.mark.parametrize("kind", ["overlapping", "non-overlapping", "hadamard"])
def test_degrees_of_freedom_of_readings_are_those_of_the_quadratic_form(alpha, kind):
    n = 60
    to_phase = np.tril(np.ones((n + 1, n)), -1)
    drive = {2: np.diff(np.eye(n + 1), axis=0), 0: np.eye(n), -2: np.tril(np.ones((n, n)))}[alpha]
    order = 3 if kind == "hadamard" else 2
    for m in (1, 2, 5, 12):
        p = to_phase
        for _ in range(order):
            p = p[m:] - p[:-m]
        covariance = (p @ drive) @ (p @ drive).T
        if kind == "non-overlapping":
            covariance = covariance[::m, ::m]
        # V = zᵀz has mean tr C and variance 2 tr C²; the tool adds only rounding.
        exact = np.trace(covariance) ** 2 / np.sum(covariance**2)
        assert _core.allan_degrees(n, m, TYPES[alpha], KINDS[kind]) == pytest.approx(max(1.0, exact), rel=1e-9)


@pytest.mark.parametrize(
    ("question", "words"),
    [
        (lambda: allan_deviation([1.0], 1.0), "at least 2 readings"),
        (lambda: allan_deviation(NINE, 1.0, [5]), "longer log"),
        (lambda: allan_deviation([np.nan] * 9, 1.0), "no finite reading"),
        (lambda: allan_deviation([*NINE, np.nan], 1.0, kind="modified"), "not defined where readings are missing"),
        (lambda: stream_noise([], 1.0), "no chunk"),
        (lambda: stream_noise([[1.0, np.inf, 2.0]], 1.0), "reading 1"),
    ],
)
def test_a_malformed_question_is_refused_in_words(question, words):
    with pytest.raises(ValueError, match=words):
        question()


def test_intervals_of_the_total_deviation_hold_the_allan_deviation_under_quantisation_noise():
    rng = np.random.default_rng(10)
    n, clusters = 1024, np.array([16, 64, 256, 500])
    truth = 3.0 / clusters.astype(float) ** 2
    inside = np.zeros(len(clusters))
    runs = 200
    for _ in range(runs):
        curve = allan_deviation(np.diff(rng.normal(size=n + 1)), 1.0, clusters, "total")
        inside += (curve.lower**2 <= truth) & (truth <= curve.upper**2)
    # 95 % of 200, four binomial errors of 1.5 % either way; before, 40 % at the longest.
    assert np.all(np.abs(inside / runs - 0.95) < 0.062), inside / runs


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """An hour of six axes at 50 Hz, with header."""
    rng = np.random.default_rng(31)
    n = 180_000
    gyro = [in_time(rng, n, RATE, N=2e-4, K=3e-6) for _ in range(3)]
    accel = [in_time(rng, n, RATE, N=2e-3, K=3e-5) + (9.81 if axis == 2 else 0.0) for axis in range(3)]
    path = tmp_path_factory.mktemp("noise") / "log.npz"
    names = ("gx_rad_s", "gy_rad_s", "gz_rad_s", "ax_m_s2", "ay_m_s2", "az_m_s2")
    np.savez(path, t_s=np.arange(n) / RATE, **dict(zip(names, (*gyro, *accel), strict=True)))
    return path


@pytest.fixture(scope="module")
def files(log):
    """What the command writes, by its kind; "txt" is what it prints."""
    made = {kind: log.parent / f"x.{kind}" for kind in ("csv", "json", "png", "html", "txt")}
    wanted = zip(("--csv", "--json", "--plot", "--report"), made.values(), strict=False)
    with made["txt"].open("w", encoding="utf-8") as out, redirect_stdout(out):
        assert main(["allan", str(log), "--full", *(str(word) for pair in wanted for word in pair)]) == 0
    return made


def test_the_files_of_the_command_hold_terms_curve_and_figures(files):
    document = json.loads(files["json"].read_text())
    assert [axis["name"] for axis in document["axes"]][:2] == ["gyro x", "gyro y"]
    for axis in document["axes"]:
        truth = 2e-4 if axis["unit"] == "rad/s" else 2e-3
        assert axis["terms"]["B"]["limit"] == axis["terms"]["B"]["upper"] > 0.0
        assert [axis["terms"]["N"][which] for which in ("value", "fitted")] == pytest.approx([truth] * 2, rel=0.01)
        # A walk that an hour hardly shows: 1.5 hundredths of N; six intervals of 95 %, fixed by the seed.
        assert axis["terms"]["K"]["lower"] <= 0.015 * truth <= axis["terms"]["K"]["upper"]
        assert set(axis["slow_pair"]) == {"evidence", "is_present"}
    rows = list(csv.reader(io.StringIO(files["csv"].read_text())))
    assert len(rows) == 1 + len(document["curve"]["tau_s"])
    assert files["png"].read_bytes().startswith(b"\x89PNG")
    assert files["html"].read_text().count("<figure id=") == 1


def test_the_size_of_a_count_gives_a_log_in_counts_its_units(tmp_path, capsys):
    rng = np.random.default_rng(33)
    counts = np.round(rng.normal(scale=20.0, size=(20_000, 6))).astype(np.int16)
    counts[:, 5] += 300
    path = tmp_path / "counts.npy"
    np.save(path, counts)
    said = ["--columns", "gx,gy,gz,ax,ay,az", "--rate", "100", "--gyro-lsb", "0.05 deg/s", "--accel-lsb", "3.33 mg"]
    for extra in ([], ["--stream"]):
        assert main(["allan", str(path), *said, "--json", *extra]) == 0
        axes = json.loads(capsys.readouterr().out)["axes"]
        assert [axis["unit"] for axis in axes] == ["rad/s"] * 3 + ["m/s^2"] * 3
        # 20 counts a reading at 100 Hz; 20 000 readings give N to 0.5 %.
        assert axes[0]["terms"]["N"]["value"] == pytest.approx(np.radians(0.05) * 2.0, rel=0.02)
        assert axes[5]["terms"]["N"]["value"] == pytest.approx(3.33e-3 * 9.80665 * 2.0, rel=0.02)
    assert main(["allan", str(path), *said[:4]]) == 0
    assert "--gyro-lsb SIZE --accel-lsb SIZE" in " ".join(capsys.readouterr().out.replace("\\\n", "").split())
    assert "number and a unit" in rejected(capsys, "allan", path, *said[:-1], "3.33")
    # Readings in SI were multiplied, and N was a thousandth.
    in_si = tmp_path / "si.csv"
    header = ",".join([f"g{axis} [rad/s]" for axis in "xyz"] + [f"a{axis} [m/s^2]" for axis in "xyz"])
    np.savetxt(in_si, 1e-3 * counts[:2000], "%.6g", ",", header=header, comments="")
    assert "not in counts" in rejected(capsys, "allan", in_si, "--rate", "100", *said[4:])


def test_lost_rows_become_missing_readings_not_shorter_time():
    rng = np.random.default_rng(32)
    n = 60_000
    kept = np.ones(n, dtype=bool)
    kept[20_000:26_000] = False
    gyro = np.column_stack([in_time(rng, n, RATE, N=1e-3, K=1e-4) for _ in range(3)])
    recording = Recording(np.arange(n)[kept] / RATE, None, gyro[kept], RATE, gyroscope_unit=RateUnit.DEG_S)
    found = noise_of(recording)
    assert found.curve.n_samples == n
    assert found.axes[0].unit == "rad/s"
    assert found.axes[0].value("N") == pytest.approx(np.radians(1e-3), rel=0.02)
    assert "°/√h" in str(noise_report(found))
    assert curve_csv(found).startswith("tau_s,cluster,gyro_x_deviation[rad/s]")


def test_a_calibration_gives_a_log_in_counts_its_units_axis_by_axis(log):
    whole, per_count = trihedron.read(log), np.array([1e-4, 2e-4, 4e-4])
    counts = replace(whole, **{s: getattr(whole, s)[:20_000] for s in ("time_s", "accelerometer", "gyroscope")})
    readings = {"gyroscope": counts.gyroscope / per_count, "accelerometer": counts.accelerometer / 6e-4}
    raw = replace(counts, **readings, gyroscope_unit=RateUnit.COUNTS, accelerometer_unit=AccelerationUnit.COUNTS)
    known = given((6e-4 * np.eye(3), np.zeros(3)), (np.diag(per_count), np.zeros(3)), raw_unit="counts")
    plain, told = noise_of(counts), noise_of(raw, calibration=known)
    for one, other in zip(plain.axes, told.axes, strict=True):
        assert other.unit == one.unit
        assert other.terms["N"].value == pytest.approx(one.terms["N"].value, rel=1e-6)
