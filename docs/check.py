"""Checks a built site: every link within it leads somewhere, and no page is heavy."""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

MOST_BYTES = 3_000_000


class Page(HTMLParser):
    """What a page links to and loads, and where one can link to."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loads, self.ids = set(), set(), set()
        self.feed(path.read_text(encoding='utf-8'))

    def handle_starttag(self, tag, attrs):
        """Collect links, pictures, scripts and ids."""
        found = dict(attrs)
        self.ids |= {found[key] for key in ('id', 'name') if found.get(key)}
        if tag == 'a' and found.get('href'):
            self.links.add(found['href'])
        loaded = found.get('href') if tag == 'link' else found.get('src')
        if loaded and found.get('loading') != 'lazy':
            self.loads.add(loaded)


def problems(root):
    """Yield what is wrong with the site in a folder."""
    found = sorted(set(root.rglob('*.html')) - set(root.glob('_static/**/*.html')))
    pages = {path: Page(path) for path in found}
    for path, page in pages.items():
        size = path.stat().st_size
        for link in page.links | page.loads:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc or link == '#':
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if not target.exists():
                yield f'{path.relative_to(root)}: {link} leads nowhere'
            elif parts.fragment and target in pages and link in page.links:
                if unquote(parts.fragment) not in pages[target].ids:
                    yield f'{path.relative_to(root)}: {link} has no such place'
            elif link in page.loads and target.is_file():
                size += target.stat().st_size
        if size > MOST_BYTES:
            yield f'{path.relative_to(root)}: {size:,} bytes with what it loads'


if __name__ == '__main__':
    found = list(problems(Path(sys.argv[1]).resolve()))
    print('\n'.join(found) or 'all links lead somewhere, and all pages are light')
    sys.exit(bool(found))
