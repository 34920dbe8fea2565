"""The page around a scene: style, scripts and messages, put together from the files beside it."""

from __future__ import annotations

import base64
import hashlib
import html
import re
from pathlib import Path

FOLDER = Path(__file__).parent / 'page'
_IMPORT = re.compile(r"^import \{([^}]*)\} from '\./([\w-]+)\.js';$", re.MULTILINE)
_EXPORT = re.compile(
    r'^export (?=(?:async )?(?:class|function\*?|const|let) ([\w$]+))', re.MULTILINE
)


def bundle(entry='main') -> str:
    """Return a module of `page` and what it imports as one script that is no module."""
    # Modules cannot be imported from files on disk; each becomes a function that is called once.
    texts: dict[str, str] = {}
    _gather(entry, texts, ())
    parts = ["'use strict';", 'const modules = {};']
    parts += [f'modules[{name!r}] = (() => {{\n{text}\n}})();' for name, text in texts.items()]
    return '(() => {\n' + '\n'.join(parts) + '\n})();'


def _gather(name, texts, above):
    """Put a module after those that it imports."""
    if name in above:
        raise ValueError(f'modules must not import each other, got {" -> ".join((*above, name))}')
    if name in texts:
        return
    text = (FOLDER / f'{name}.js').read_text(encoding='utf-8')
    for match in _IMPORT.finditer(text):
        _gather(match[2], texts, (*above, name))
    names = _EXPORT.findall(text)
    text = _IMPORT.sub(_import_line, text)
    texts[name] = f'{_EXPORT.sub("", text)}\nreturn {{ {", ".join(names)} }};'


def _import_line(match):
    """Return an import as the reading of a module that was called before."""
    return f'const {{{match[1].replace(" as ", ": ")}}} = modules[{match[2]!r}];'


def page_of(title, chunks) -> str:
    """Return a page: message, script, and texts as data blocks, of which the first is JSON."""
    # The message comes first, so that a file that is cut off anywhere says so; the policy allows
    # no host, and no script but the page's own.
    script = bundle()
    if '</script' in script.lower():
        raise ValueError('scripts of pages must not contain a closing tag of scripts')
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    blocks = [
        f'<script type="application/octet-stream" data-chunk="{number}">{text}</script>'
        for number, text in enumerate(chunks)
    ]
    values = {
        'title': html.escape(title),
        'style': (FOLDER / 'page.css').read_text(encoding='utf-8'),
        'script': script,
        'digest': digest,
        'blocks': '\n'.join(blocks),
    }
    template = (FOLDER / 'page.html').read_text(encoding='utf-8')
    return re.sub(r'\{\{(\w+)\}\}', lambda m: values[m[1]], template)
