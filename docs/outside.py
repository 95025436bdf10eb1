"""A hook of MkDocs: pages at the root of the repository belong to the site, and links to its files lead there.

Pages are written as a forge shows them: docs/upsample.md links to ../RESULTS.md, and RESULTS.md to docs/upsample.md.
"""

import re
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
PAGES = ("RESULTS.md", "PAPER.md", "CONTRIBUTING.md", "CHANGELOG.md")
"""Pages of the site that lie at the root."""
LINK = re.compile(r"(?<=\]\()(?!https?:|mailto:|#)([^)\s#]+)(#[^)\s]*)?(?=\))")


def on_files(files: Files, config: Any) -> Files:
    """Add the pages at the root."""
    for page in PAGES:
        files.append(File.generated(config, page, abs_src_path=str(ROOT / page)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, **_: Any) -> str:
    """Make the links of a page those of the site."""
    source = page.file.src_uri
    folder = PurePosixPath("." if source in PAGES else f"docs/{source}").parent
    return LINK.sub(
        lambda link: target(link[1], folder, source, config.extra["repository"]) + (link[2] or ""), markdown
    )


def target(link: str, folder: PurePosixPath, source: str, repository: str) -> str:
    """Where a link leads on the site: to a page beside it, or to the repository.

    Args:
        link: as it is written, relative to `folder`.
        folder: of the page in the repository.
        source: the page's path on the site.
        repository: its address.
    """
    path = (ROOT / folder / link).resolve().relative_to(ROOT).as_posix()
    if path in PAGES:
        inside = path
    elif path.startswith("docs/") and (ROOT / path).is_file():
        inside = path.removeprefix("docs/")
    else:
        return f"{repository}/blob/main/{path}"
    return "../" * source.count("/") + inside
