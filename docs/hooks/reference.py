"""Pages made when the site is built: commands, Python, findings, effects and schemas from the code; notebooks."""

from __future__ import annotations

import json
import sys
from base64 import b64decode
from importlib.resources import files
from pathlib import Path
from typing import Any

import mkdocs_gen_files
import typer

import trihedron
from trihedron.cli import build_app
from trihedron.cli.help import described

# Scripts of the site are run by their path.
sys.path.insert(0, str(Path(__file__).parent))
from catalogues import effects_page as effects
from catalogues import page as findings


def commands() -> str:
    """Every command with its arguments and options, as ``--help`` knows them."""
    group: Any = typer.main.get_command(build_app())
    out = ["# Commands", "", "What `trihedron COMMAND --help` says.", ""]
    out.append(" · ".join(f"[`{name}`](#{name})" for name in group.commands))
    for name, command in group.commands.items():
        out += ["", f"## {name}", "", (command.help or "").split("\f")[0].strip(), ""]
        context = command.context_class(command, info_name=f"trihedron {name}")
        out += ["```text", " ".join([f"trihedron {name}", *command.collect_usage_pieces(context)]), "```", ""]
        rows = [cells for _, *cells in described(command, context)]
        out += ["| argument or option | |", "|---|---|"] if rows else []
        out += [f"| `{_cell(left)}` | {_cell(right)} |" for left, right in rows]
    return "\n".join(out) + "\n"


def python() -> str:
    """What ``dir(trihedron)`` lists, each with its docstring, then the records that the verbs return."""
    out = ["# Python", "", "Everything public stands in `trihedron`.", ""]
    out += [f"::: trihedron.{name}\n" for name in sorted(trihedron.__all__) if not name.startswith("__")]
    return "\n".join(out)


def schemas() -> str:
    """The keys of our JSON documents, from the schemas that they are checked against."""
    out = ["# JSON", "", "Keys of the files that are written, from the schemas installed with the package", ""]
    out[-1] += "(`trihedron/files/schema/`). A key in **bold** is always there. `null`: not a finite number."
    for path in sorted((entry for entry in files("trihedron.files.schema").iterdir()), key=lambda entry: entry.name):
        if not path.name.endswith(".json"):
            continue
        schema = json.loads(path.read_text(encoding="utf-8"))
        out += ["", f"## {path.name}", "", schema["description"], "", *_keys(schema)]
        for name, part in schema.get("$defs", {}).items():
            if "properties" in part:
                out += ["", f"### {path.name.split('.')[0]}: {name}", "", part.get("description", ""), "", *_keys(part)]
    return "\n".join(out) + "\n"


def _keys(part: dict[str, Any]) -> list[str]:
    rows = ["| key | type | meaning |", "|---|---|---|"]
    for name, of in part.get("properties", {}).items():
        shown = f"**`{name}`**" if name in part.get("required", ()) else f"`{name}`"
        rows.append(f"| {shown} | {_cell(_type(of))} | {_cell(of.get('description', ''))} |")
    return rows


def _type(of: dict[str, Any]) -> str:
    if "$ref" in of:
        return str(of["$ref"].rpartition("/")[2])
    if "const" in of:
        return f"`{json.dumps(of['const'])}`"
    if "enum" in of:
        return ", ".join(f"`{json.dumps(value)}`" for value in of["enum"])
    if "anyOf" in of:
        return " or ".join(_type(one) for one in of["anyOf"])
    named = of.get("type", "any")
    named = " or ".join(named) if isinstance(named, list) else named
    return f"array of {_type(of['items'])}" if named == "array" and "items" in of else named


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


PAGES = {"commands": commands, "python": python, "findings": findings, "effects": effects, "schemas": schemas}
for name, made in PAGES.items():
    with mkdocs_gen_files.open(f"reference/{name}.md", "w") as page:
        page.write(made())


def notebook(cells: list[dict[str, Any]], name: str) -> str:
    """An executed notebook as a page: cells and what they gave, pictures beside it."""
    out: list[str] = []
    for number, cell in enumerate(cells):
        source = "".join(cell["source"])
        out += [source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```", ""]
        for given in cell.get("outputs", ()):
            data = given.get("data", {})
            if "image/png" in data:
                with mkdocs_gen_files.open(f"tutorials/{name}-{number}.png", "wb") as picture:
                    picture.write(b64decode(data["image/png"]))
                out += [f"![What the cell above draws]({name}-{number}.png)", ""]
            elif "text/html" in data:
                # On one line: a blank one would end the block of HTML.
                out += [f'<div class="given">{" ".join("".join(data["text/html"]).split())}</div>', ""]
            elif text := "".join(given.get("text", data.get("text/plain", ()))):
                out += ["```text", text.rstrip(), "```", ""]
    return "\n".join(out)


for path in sorted(Path(__file__).parents[1].glob("tutorials/*.ipynb")):
    with mkdocs_gen_files.open(f"tutorials/{path.stem}.md", "w") as page:
        page.write(notebook(json.loads(path.read_text(encoding="utf-8"))["cells"], path.stem))
