"""A file's name is somebody else's text: it stays one line wherever it stands in a report."""

import os
import subprocess
import sys

from trihedron.report.document import Document, Section
from trihedron.report.page import to_html

NAMED = Document(
    title="Calibration of a\nb.csv",
    subtitle="/logs/a\nNOT TO BE TRUSTED\t.csv",
    verdict="usable",
    is_trustworthy=True,
    sections=(Section("Poses of a\nb", ()),),
)


def test_a_line_end_in_a_name_is_spelled_out_in_the_page():
    page = to_html(NAMED)
    assert r"/logs/a\nNOT TO BE TRUSTED\t.csv" in page
    assert "a\nNOT TO BE" not in page
    assert "a\nb" not in page


def test_an_interrupt_without_standard_error_says_nothing_on_standard_output():
    code = (
        "import sys, trihedron.__main__ as m\n"
        "def stop(): raise KeyboardInterrupt\n"
        "m.install = stop\n"
        "assert sys.stderr is None\n"
        "sys.exit(m.main())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, check=False, preexec_fn=lambda: os.close(2)
    )
    assert done.stdout == b""
    assert done.returncode == 130
