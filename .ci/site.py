#!/usr/bin/env python3
"""Build the documentation site with MkDocs Material, in `build/site`.

    python3 .ci/site.py

The pages are those of `docs/`, each library's README, the examples, and a reference of every public
module, made by mkdocstrings from the docstrings. Links between them that would leave the site in a
checkout are turned to the page that they mean. `--strict` makes a link or an anchor that leads
nowhere an error. The site loads nothing from other hosts: the script that draws comes from the npm
package mermaid at build time. `codespell` reads what people wrote.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import venv
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(CHECKOUT))

from launcher.environment import LIBRARIES, PACKAGES  # noqa: E402

SITE = CHECKOUT / 'build' / 'site'
TOOLS = ['mkdocs-material>=9.5,<10', 'mkdocstrings[python]>=0.26,<2', 'codespell>=2.4,<3']
DRAWING = 'mermaid@11.4.1'
"""The npm package of the script that draws."""

KNOWN = 'empy,datas'
"""What codespell takes for a mistake and is none."""

FOUND_FIRST = {'how-to': 4.0, 'tutorial': 3.0, 'reference': 1.5, 'api': 0.3, 'project': 0.5}
"""How much a folder's pages count in the search; else 1."""

SECTIONS = {
    'Start': ('tutorial',),
    'How to': ('how-to',),
    'Reference': ('reference', 'api'),
    'Explanation': ('explanation',),
    'Libraries': ('libraries',),
    'Project': ('project',),
}
"""The folders of each section."""
CONFIG = """\
site_name: Surveillance robot
docs_dir: pages
site_dir: html
use_directory_urls: false
theme:
  name: material
  font: false
  features: [navigation.sections, navigation.top, toc.follow, search.highlight]
  palette:
    - media: '(prefers-color-scheme: light)'
      scheme: default
    - media: '(prefers-color-scheme: dark)'
      scheme: slate
plugins:
  - search
  - mkdocstrings:
      handlers:
        python:
          paths: [{paths}]
          options:
            docstring_style: google
            show_source: false
            show_root_heading: true
            members_order: source
            filters: ['!^_']
markdown_extensions:
  - tables
  - admonition
  - toc:
      permalink: true
  - pymdownx.superfences:
      custom_fences:
        - name: mermaid
          class: mermaid
          format: !!python/name:pymdownx.superfences.fence_code_format
validation:
  links:
    not_found: warn
    anchors: warn
extra_javascript: [{scripts}]
nav:
{nav}
"""


def main() -> int:
    """Assemble the pages, build, and return the exit code."""
    shutil.rmtree(SITE / 'pages', ignore_errors=True)
    pages = SITE / 'pages'
    moved = gather(pages)
    reference(pages)
    scripts = drawing_script(pages)
    for path in pages.rglob('*.md'):
        text = path.read_text(encoding='utf-8')
        text = relinked(text, path.relative_to(pages), moved)
        counts = FOUND_FIRST.get(path.parent.name)
        if counts is not None:
            text = f'---\nsearch:\n  boost: {counts}\n---\n\n{text}'
        path.write_text(text, encoding='utf-8')
    paths = ', '.join(
        str(CHECKOUT / folder) for folder in (*(f'libs/{name}' for name in LIBRARIES), *PACKAGES)
    )
    config = CONFIG.format(paths=paths, nav=navigation(pages), scripts=', '.join(scripts))
    (SITE / 'mkdocs.yml').write_text(config, encoding='utf-8')
    python = SITE / 'venv' / 'bin' / 'python'
    if not python.exists():
        venv.create(SITE / 'venv', with_pip=True)
    pip = [str(python), '-m', 'pip', 'install', '-q', '--disable-pip-version-check', *TOOLS]
    subprocess.run(pip, check=True)
    build = [str(python), '-m', 'mkdocs', 'build', '--strict', '-q', '-f', str(SITE / 'mkdocs.yml')]
    environ = {**os.environ, 'NO_MKDOCS_2_WARNING': '1', 'DISABLE_MKDOCS_2_WARNING': 'true'}
    code = subprocess.run(build, env=environ, check=False).returncode
    code = code or spelled(SITE / 'venv' / 'bin' / 'codespell') or foreign(SITE / 'html')
    if code == 0:
        print(f'the site is in {SITE / "html"}: {len(list((SITE / "html").rglob("*.html")))} pages')
    return code


def drawing_script(pages: Path) -> list[str]:
    """Put the script that draws beside the pages; none where npm is not there."""
    if shutil.which('npm') is None:
        print('no npm: drawings are shown as text')
        return []
    folder = SITE / 'npm'
    folder.mkdir(parents=True, exist_ok=True)
    archive = folder / f'{DRAWING.replace("@", "-")}.tgz'
    if not archive.exists():
        subprocess.run(['npm', 'pack', '--silent', DRAWING], cwd=folder, check=True)
    (pages / 'scripts').mkdir(parents=True, exist_ok=True)
    with tarfile.open(archive) as files:
        script = files.extractfile('package/dist/mermaid.min.js')
        assert script is not None
        (pages / 'scripts' / 'mermaid.min.js').write_bytes(script.read())
    return ['scripts/mermaid.min.js']


def spelled(codespell: Path) -> int:
    """Return 0 if no word of the pages is a common misspelling."""
    words = [str(codespell), '-L', KNOWN, '--skip', '*.svg,*.png,*.gif,*.jpg,*.py']
    return subprocess.run(
        [*words, 'docs', 'README.md', 'CONTRIBUTING.md', 'SECURITY.md'], cwd=CHECKOUT, check=False
    ).returncode


def foreign(html: Path) -> int:
    """Return 0 if no page loads a script, style, picture or font of another host."""
    loads = re.compile(
        r'<(?:script|img|iframe|source)[^>]*\ssrc="?(https?:)?//|<link[^>]*rel="?stylesheet[^>]*https?://'
    )
    found = [path for path in html.rglob('*.html') if loads.search(path.read_text('utf-8'))]
    for path in found:
        print(f'{path}: loads from another host')
    return int(bool(found))


def gather(pages: Path) -> dict[str, str]:
    """Copy what people read; return where each file of the checkout stands in the site."""
    docs = CHECKOUT / 'docs'
    wanted = {
        f'docs/{page.relative_to(docs)}': f'{page.relative_to(docs)}' for page in docs.rglob('*.md')
    }
    wanted |= {'README.md': 'index.md', 'CONTRIBUTING.md': 'project/contributing.md'}
    wanted |= {'CHANGELOG.md': 'project/changelog.md', 'examples/README.md': 'how-to/examples.md'}
    wanted |= {'SECURITY.md': 'project/report_a_weakness.md'}
    wanted |= {'CODE_OF_CONDUCT.md': 'project/conduct.md'}
    wanted |= {f'libs/{name}/README.md': f'libraries/{name}.md' for name in LIBRARIES}
    for folder in ('images', 'proxy'):
        for path in sorted((docs / folder).glob('*')):
            wanted[f'docs/{folder}/{path.name}'] = f'{folder}/{path.name}'
    for source, target in wanted.items():
        if (CHECKOUT / source).is_file():
            (pages / target).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(CHECKOUT / source, pages / target)
    return {source: target for source, target in wanted.items() if (CHECKOUT / source).is_file()}


def relinked(text: str, page: Path, moved: dict[str, str]) -> str:
    """Return a page whose links lead to pages of the site; what is no page becomes plain words."""
    source = next((s for s, t in moved.items() if t == page.as_posix()), None)
    if source is None:
        return text
    folder = Path(source).parent

    def turned(match: re.Match[str]) -> str:
        bang, label, target = match.groups()
        path, _, anchor = target.partition('#')
        if not path or re.match(r'[a-z]+:', path):
            return match[0]
        meant = os.path.normpath(folder / path)
        if meant not in moved:
            return f'{bang}{label}' if bang else f'{label} (`{meant}`)'
        new = os.path.relpath(moved[meant], page.parent)
        return f'{bang}[{label}]({new}{"#" + anchor if anchor else ""})'

    return re.sub(r'(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)', turned, text)


def reference(pages: Path) -> None:
    """Write a page for each package with its public modules."""
    (pages / 'api').mkdir(parents=True, exist_ok=True)
    for names in (LIBRARIES, PACKAGES):
        for name in names:
            folder = CHECKOUT / ('libs' if names is LIBRARIES else '') / name / name
            modules = sorted(
                '.'.join([name, *path.relative_to(folder).with_suffix('').parts])
                for path in folder.rglob('*.py')
                if not any(part.startswith('_') for part in path.relative_to(folder).parts)
                and (names is LIBRARIES or not path.stem.endswith('_node'))
            )
            lines = [f'# {name}', '', f'::: {name}', '    options:', '      members: false', '']
            for module in modules:
                lines += [f'::: {module}', '']
            (pages / 'api' / f'{name}.md').write_text('\n'.join(lines), encoding='utf-8')


def navigation(pages: Path) -> str:
    """Return the tree of pages as YAML."""
    lines = ['  - Front: index.md']
    for title, folders in SECTIONS.items():
        lines.append(f'  - {title}:')
        for folder in folders:
            names = sorted(page.name for page in (pages / folder).glob('*.md'))
            lines += [f'      - {folder}/{name}' for name in names]
    return '\n'.join(lines)


if __name__ == '__main__':
    sys.exit(main())
