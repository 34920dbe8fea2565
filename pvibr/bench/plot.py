"""Run time against error on one plot."""

from __future__ import annotations


def plot(results, path):
    """Draw what was measured: the walk at the left, single meshes at the right.

    Parameters
    ----------
    results : Results
        With its points.
    path : pathlib.Path
        PNG file.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 5), layout='constrained')
    FigureCanvasAgg(figure)
    walk, single = figure.subplots(1, 2)
    _walk(walk, results.points)
    _single(single, results.points.get('single', {}))
    figure.suptitle(f'pvibr bench instances: {results.driver}')
    figure.savefig(path, dpi=110)


def _walk(axes, points):
    own = points['pvibr']
    axes.plot([p['ms'] for _, p in own], [p['flip'] for _, p in own], 'o-', label='pvibr')
    for k, (max_error, p) in enumerate(own):
        # Above and below by turns: points of close errors lie close together.
        place = {'xytext': (4, 8 if k % 2 else -14), 'textcoords': 'offset points'}
        axes.annotate(f'{max_error:g} px', (p['ms'], p['flip']), **place)
    glyphs, lod = points['glyphs'], points['glyphs, culling + LOD']
    axes.plot(glyphs['ms'], glyphs['flip'], 's', label='VTK glyphs, full meshes (extrapolated)')
    # The glyph mapper shows no colours of vertices, so its error would be one of colour.
    axes.axvline(lod['ms'], ls='--', color='0.5', label='VTK glyphs, culling + LOD')
    axes.set(xscale='log', xlabel='ms a frame', title='walk')
    axes.set(ylabel='mean FLIP against 16 samples a pixel', ylim=(0, 1.2 * axes.dataLim.ymax))
    axes.legend(fontsize='small')


def _single(axes, meshes):
    for name, by_size in meshes.items():
        sizes = list(by_size)
        key = '1.0' if '1.0' in by_size[sizes[0]] else list(by_size[sizes[0]])[-1]
        axes.plot(sizes, [by_size[size][key][0] for size in sizes], 'o-', label=name)
    axes.axhline(1.0, color='0.5', ls='--')
    axes.set_xscale('log', base=2)
    axes.set(xlabel='diameter on the screen, px', ylim=(0, None), title='single meshes')
    axes.set_ylabel('FLIP over that of the mesh at one sample')
    axes.legend(fontsize='small')
