"""Curves of the benches' plots."""

from __future__ import annotations


def subplots(figure, rows, columns, **options):
    """Return new axes in a figure of a size that suits them."""
    figure.set_size_inches(6 * columns, 4.8 * rows)
    return figure.subplots(rows, columns, **options)


def curve(axes, points, x, y, **style):
    """Draw one number of points against another, as a line of dots."""
    style = {'marker': 'o', **style}
    axes.plot([p[x] for p in points], [p[y] for p in points], **style)


def note(axes, text, x, y, place=(4, 5), size='x-small'):
    """Write beside a point."""
    axes.annotate(text, (x, y), xytext=place, textcoords='offset points', fontsize=size)


def bar(axes, value, label='bar'):
    """Draw a bar as a dashed line."""
    axes.axhline(value, color='0.5', ls='--', label=label)
