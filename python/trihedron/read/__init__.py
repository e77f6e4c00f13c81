"""Reading: converts logs of any common layout to one audited :class:`~trihedron.records.Recording`.

The format is recognised by the file's first bytes, columns and units by their names, then by the readings; every choice
is stated as a finding. A file that cannot become a recording raises :class:`ReadError` with one sentence.
"""

from trihedron.read.archive import devices_of
from trihedron.read.axis_noise import read_axis_noise
from trihedron.read.errors import ReadError
from trihedron.read.on_disk import ChunkedLog, open_chunks
from trihedron.read.pose_table import read_pose_table
from trihedron.read.recording import read_recording
from trihedron.records import Progress
