# %% [markdown]
# # A simulation that does not fit, and what to do
# The same as docs/worked-example.md, cell by cell (VS Code, Jupytext or plain Python).

# %%
from pathlib import Path

import trihedron
from trihedron.api.improving import improve
from trihedron.simulate import read_scenario, simulate

LATITUDE_DEG = 59.94
Path("ideal.toml").write_text('name = "my-simulation"\nprofile = "ideal"\n\n[session]\nkind = "hand"\n')
Path("unit.toml").write_text(
    'profile = "mpu"\nunit = 4711\n\n[environment]\nlatitude_deg = 59.94\n\n[session]\nkind = "hand"\n\n'
    '[[effect]]\nid = "gyro-g-sensitivity"\nmatrix = [[0, 3e-4, 0], [0, 0, -2e-4], [1e-4, 0, 2e-4]]\n'
)

# %% [markdown]
# The recording: here of a simulated unit; with your own, `recording = trihedron.read("log.csv")`.

# %%
recording, _ = simulate(read_scenario("unit.toml"), 7)

# %% [markdown]
# Where do scenario and recording differ?

# %%
found = trihedron.diagnose(recording, latitude_deg=LATITUDE_DEG, against="ideal.toml")
print(found)

# %%
for effect in found.effects:
    print(effect.id, *(f"{p.name} {p.value:.3g} ± {p.std:.1g} {p.unit}" for p in effect.parameters), sep="\n  ")

# %% [markdown]
# The student's own file with what the recording says, and the same question again.

# %%
Path("better.toml").write_text(improve("ideal.toml", found).text)
again = trihedron.diagnose(recording, latitude_deg=LATITUDE_DEG, against="better.toml")
print(again.verdict)

# %% [markdown]
# A simulation that these tests cannot tell from the recording.

# %%
simulation, truth = simulate(read_scenario("better.toml"), 1)
print(simulation)
