"""Outputs: whole or not at all, never over an input, never in the place of a device, and cleared up after a kill."""

import contextlib
import os
import resource
import signal
import stat
import threading
import time

import pytest
import typer

from small_session import G, copied, leftovers, quietly, run, started
from trihedron.cli import COMMANDS, build_app, main
from trihedron.files.output import MARK, OutputError, Temporary, write_whole

UNTRUSTED = {
    "allan": ["allan", "log.csv", "--calibration", "untrusted.json", "--exclude", "6:"],
    "apply": ["apply", "untrusted.json", "log.csv", "-o", "x.csv"],
    "verify": ["verify", "untrusted.json", "log.csv"],
    "diagnose": ["diagnose", "log.csv", "--calibration", "untrusted.json"],
    "simulate": ["simulate", "--like", "log.csv", "--calibration", "untrusted.json", "-o", "x.csv"],
    "export": ["export", "untrusted.json", "--to", "c"],
}


@pytest.fixture
def session(tmp_path):
    return copied(tmp_path)


WHOLE = ["--gravity", G]
OUTPUTS = {
    "check": [["check", "log.csv", "--json"], ["check", "log.csv", "--report"]],
    "segment": [["segment", "log.csv", "--json"], ["segment", "log.csv", "--report"]],
    "calibrate": [["calibrate", "log.csv", *WHOLE, flag] for flag in ("-o", "--json", "--report")],
    "allan": [["allan", "static.csv", flag] for flag in ("--json", "--csv", "--plot", "--report")],
    "noise": [["noise", "static.csv", flag] for flag in ("--json", "--report")],
    "kalman": [["kalman", "log.csv", *WHOLE, flag] for flag in ("-o", "--json", "--report")],
    "verify": [["verify", "c.json", "log.csv", flag] for flag in ("--json", "--report")],
    "diagnose": [["diagnose", "log.csv", *WHOLE, flag] for flag in ("--json", "--report")],
    "apply": [["apply", "c.json", "log.csv", flag] for flag in ("-o", "--json")],
    "convert": [["convert", "log.csv", "-o"]],
    "export": [["export", "c.json", "--noise", "noise.json", "--to", "python", "-o"]],
    "simulate": [
        ["simulate", "s.toml", "-o"],
        ["simulate", "--like", "log.csv", "--calibration", "c.json", "-o"],
        ["simulate", "s.toml", "-o", "x.csv", "--truth"],
    ],
    "guide": [["guide", "log.csv", "-o"]],
    "report": [["report", "n.json", "--report"]],
}
NO_INPUT_FILE = {"demo", "plan", "ports", "capture"}
# Writes a folder of its own; tests/test_fleet.py says what it does to one that exists.
INTO_A_FOLDER = {"fleet"}


def test_every_command_that_reads_a_file_is_attacked_here():
    assert {c.__name__.replace("_", "-") for c in COMMANDS} - NO_INPUT_FILE - INTO_A_FOLDER <= set(OUTPUTS)


@pytest.mark.parametrize("command", OUTPUTS)
def test_no_output_lies_on_an_input_even_with_force(session, capsys, monkeypatch, command):
    monkeypatch.chdir(session)
    for words in OUTPUTS[command]:
        inputs = [w for w in words if (session / w).is_file()]
        for name in inputs:
            before = (session / name).read_bytes()
            ending = {"--report": ".html", "--plot": ".png", "--truth": ".json"}.get(words[-1])
            # The same file under a symbolic and a hard link as well; the ending is one that the option takes.
            suffix = ending or os.path.splitext(name)[1]
            soft, hard = session / f"soft-{name}{suffix}", session / f"hard-{name}{suffix}"
            if not soft.exists():
                soft.symlink_to(session / name)
                os.link(session / name, hard)
            for place in {name, f"./{name}", str(session / name), soft.name, hard.name}:
                status = main([*words, place, "--force"])
                err = capsys.readouterr().err
                assert status == 1, (words, place, err)
                assert (session / name).read_bytes() == before
            assert leftovers(session) == []


def test_a_device_is_written_to_and_stays_a_device(session, capsys):
    known = str(session / "c.json")
    for force in ([], ["--force"]):
        assert main(["export", known, "--to", "c", "-o", "/dev/null", *force]) == 0
        capsys.readouterr()
        assert main(["export", known, "--to", "rust", "-o", "/dev/full", *force]) == 1
        (said,) = capsys.readouterr().err.strip().splitlines()
        assert "/dev/full" in said
        assert "No space left" in said
        assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
        assert stat.S_ISCHR(os.stat("/dev/full").st_mode)


@pytest.mark.parametrize("force", [False, True])
def test_a_pipe_is_written_to_however_slowly_it_is_read_and_not_where_nobody_reads(tmp_path, force, monkeypatch):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    content = os.urandom(300_000)
    got = []

    def read():
        with pipe.open("rb", buffering=0) as stream:
            while part := stream.read(20_000):
                got.append(part)
                time.sleep(0.01)

    reader = threading.Thread(target=read)
    reader.start()
    write_whole(pipe, content, overwrite=force)
    reader.join()
    assert b"".join(got) == content
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    monkeypatch.setattr("trihedron.files.output._READER_WAIT_S", 0.1)
    with pytest.raises(OutputError, match="nobody reads"):
        write_whole(pipe, b"x", overwrite=force)


def test_through_a_link_the_file_it_names_is_replaced_and_the_link_stays(tmp_path):
    real, link = tmp_path / "real", tmp_path / "link"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    write_whole(link, "new", overwrite=True)
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert stat.S_IMODE(real.stat().st_mode) == 0o640
    dangling = tmp_path / "dangling"
    dangling.symlink_to(tmp_path / "made")
    write_whole(dangling, "new")
    assert (tmp_path / "made").read_text() == "new"


def test_impossible_places_end_in_a_sentence(tmp_path):
    loop = tmp_path / "loop"
    loop.symlink_to(loop)
    locked = tmp_path / "locked"
    locked.write_text("keep")
    locked.chmod(0o444)
    plain = tmp_path / "plain"
    plain.write_text("")
    for path, words in (
        (loop, "links"),
        (locked, "read-only"),
        (tmp_path, "directory"),
        (plain / "x", "is a file and not a folder"),
        (tmp_path / "none" / "x", "no folder"),
        (tmp_path / ("n" * 300), "too long"),
        (tmp_path / "a\0b", "name of an output"),
    ):
        for overwrite in (False, True):
            if path == locked and not overwrite:
                continue
            with pytest.raises(OutputError, match=words):
                write_whole(path, "x", overwrite=overwrite)
    assert locked.read_text() == "keep"


@pytest.mark.parametrize("words", [["--help"], ["apply", "c.json", "log.csv"]])
def test_standard_output_on_a_full_disk_is_status_1(session, words):
    with open("/dev/full", "wb") as full:
        status, _, err = run(*words, cwd=session, stdout=full)
    assert status == 1, err
    assert len(err.strip().splitlines()) == 1, err
    assert "standard output" in err


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_file_that_appears_while_another_is_written_is_replaced_only_with_leave(tmp_path, overwrite, monkeypatch):
    target, write = tmp_path / "one.json", Temporary.write
    monkeypatch.setattr(Temporary, "write", lambda slow, data: (write(slow, data), target.write_text("quick")))
    with contextlib.nullcontext() if overwrite else pytest.raises(OutputError, match="meanwhile and was left alone"):
        write_whole(target, "slow", overwrite=overwrite)
    assert target.read_text() == ("slow" if overwrite else "quick")
    assert leftovers(tmp_path) == []


def test_what_a_killed_run_left_is_cleared_by_the_next_and_a_live_one_is_not_harmed(tmp_path):
    left = tmp_path / f".old.json{MARK}99999-abcdef01"
    left.write_text("half")
    other = tmp_path / ".trihedron-notes"
    with Temporary(tmp_path / "slow.json") as slow:
        slow.write(b"half")
        write_whole(tmp_path / "new.json", "whole")
        assert os.path.exists(slow.path)
        slow.put_in_place(None)
    assert not left.exists()
    assert not other.exists()
    assert (tmp_path / "slow.json").read_bytes() == b"half"
    assert leftovers(tmp_path) == []


def test_kill_9_at_any_instant_leaves_the_old_output_or_the_new_one(session):
    target = session / "out.csv"
    quietly("convert", str(session / "log.csv"), "-o", str(target))
    whole = target.read_bytes()
    for after_s in (0.2, 0.45):
        process = started("convert", session / "log.csv", "-o", target, "--force")
        time.sleep(after_s)
        process.kill()
        process.communicate()
        assert target.read_bytes() == whole
    assert quietly("convert", str(session / "log.csv"), "-o", str(target), "--force") == 0
    assert leftovers(session) == []


def test_a_small_disk_that_fills_up_leaves_the_old_output(session):
    # A limit on the size of files represents the disk: no permission to mount one is needed.
    target = session / "out.csv"
    quietly("convert", str(session / "log.csv"), "-o", str(target))
    whole = target.read_bytes()

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

    status, _, err = run("convert", session / "log.csv", "-o", target, "--force", preexec_fn=limit)
    assert status == 1
    assert "File too large" in err
    assert target.read_bytes() == whole
    assert leftovers(session) == []


def test_every_command_that_takes_a_calibration_is_asked_about_an_untrusted_one():
    commands = typer.main.get_command(build_app()).commands
    takes = {name for name, command in commands.items() if any(p.name == "calibration" for p in command.params)}
    # Where it is an output (capture, guide) nothing is read.
    assert takes - {"capture", "guide", "calibrate", "kalman"} == set(UNTRUSTED) - {"verify"}


@pytest.mark.parametrize("words", UNTRUSTED.values(), ids=list(UNTRUSTED))
def test_an_untrusted_calibration_ends_in_status_2_with_its_reason(session, capsys, words, monkeypatch):
    monkeypatch.chdir(session)
    assert main(words) == 2
    err = capsys.readouterr().err
    assert "not to be trusted" in err
    # The gravest reason: a verification with the calibration's own recording says nothing of it.
    assert ("made from this recording" if words[0] == "verify" else "Scale 3 is not") in err
