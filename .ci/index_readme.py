"""Before a package is built: README's links and the package's URLs, in the repository that the release is made from.

    python .ci/index_readme.py https://HOST/OWNER/NAME v0.1.0

The sources name no address: where they are published is known to the release alone. On a package index a relative link
leads nowhere, so the README that goes into a package holds absolute ones.
"""

import re
import sys
from pathlib import Path

_LINK = re.compile(r"(!?)\[([^]]*)\]\((?!\w+:|#)([^)\s]+)\)")


def absolute(markdown: str, repository: str, tag: str) -> str:
    """The page with pictures and files at this tag of the repository."""

    def link(found: re.Match[str]) -> str:
        picture, words, path = found.groups()
        return f"{picture}[{words}]({repository}/{'raw' if picture else 'blob'}/{tag}/{path})"

    return _LINK.sub(link, markdown)


def urls(repository: str, tag: str) -> str:
    """The table of project URLs for pyproject.toml."""
    rows = {"Source": "", "Documentation": f"/blob/{tag}/docs/index.md", "Changelog": f"/blob/{tag}/CHANGELOG.md"}
    return "\n[project.urls]\n" + "".join(f'{name} = "{repository}{path}"\n' for name, path in rows.items())


def main(repository: str, tag: str) -> None:
    readme, project = Path("README.md"), Path("pyproject.toml")
    readme.write_text(absolute(readme.read_text(encoding="utf-8"), repository, tag), encoding="utf-8")
    project.write_text(project.read_text(encoding="utf-8") + urls(repository, tag), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
