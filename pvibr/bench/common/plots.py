"""Axes and curves of the benches' plots."""

from __future__ import annotations


def several_axes(size, rows, columns, **options):
    """Return a figure that needs no screen, and its axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout='constrained')
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, **options)


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
