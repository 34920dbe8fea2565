"""Run time against error on one plot."""

from __future__ import annotations


def two_axes(size, **options):
    """Return a figure that needs no screen, and its two axes."""
    return several_axes(size, 1, 2, **options)


def several_axes(size, rows, columns, **options):
    """Return a figure that needs no screen, and its axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout='constrained')
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, **options)


def save(figure, name, results, path):
    """Write a figure with the bench and the driver above it."""
    figure.suptitle(f'pvibr bench {name}: {results.driver}')
    figure.savefig(path, dpi=110)


def plot(results, path):
    """Draw what was measured: the walk at the left, single meshes at the right."""
    figure, (walk, single) = two_axes((12, 5))
    _walk(walk, results.points)
    _single(single, results.points.get('single', {}))
    save(figure, 'instances', results, path)


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


def plot_shadows(results, path):
    """Draw what shadows add to a frame against their error: hard ones left, soft ones right."""
    figure, (hard, soft) = two_axes((13, 5.5))
    points = results.points['plot']
    _curves(hard, points['hard'], 0.2)
    hard.set_yscale('symlog', linthresh=0.01)
    hard.set(ylabel='wrong pixels, %', title='light without size, against rays', ylim=(0, None))
    _curves(soft, points['soft'], 0.03)
    soft.set(ylabel='mean absolute error of the lit share', ylim=(0, None))
    soft.set(title=f'light of a size, against 256 rays a pixel ({points["rays"]:.1f} s)')
    save(figure, 'shadows', results, path)


def _curves(axes, curves, bar):
    for name, points in curves.items():
        style = {'ls': '', 'marker': '*', 'ms': 14} if name.startswith('VTK') else {'marker': 'o'}
        axes.plot([p['ms'] for p in points], [p['error'] for p in points], label=name, **style)
        if len(points) > 1:
            for k in (0, -1):
                place = {'xytext': (4, 5), 'textcoords': 'offset points', 'fontsize': 'x-small'}
                axes.annotate(points[k]['label'], (points[k]['ms'], points[k]['error']), **place)
    axes.axhline(bar, color='0.5', ls='--', label='bar')
    axes.set(xscale='log', xlabel='ms that a frame takes longer while the camera moves')
    axes.legend(fontsize='x-small')


def plot_effects(results, path):
    """Draw what image effects cost, and for each with settings its time against its error."""
    figure, axes = several_axes((14, 9), 2, 2)
    (cost, bloom), (outline, lens) = axes
    points = results.points
    cost.barh(list(points['copies']), list(points['copies'].values()))
    cost.axvline(1, color='0.5', ls='--')
    cost.set(xlabel='full-screen copies', title='time of an effect')
    _labelled(bloom, [(p['copies'], p['error'], p['name']) for p in points['bloom']])
    bloom.axhline(0.5, color='0.5', ls='--', label='bar')
    bloom.set(title='bloom, against a true Gaussian', ylabel='mean error, of 255', yscale='log')
    _labelled(outline, [(p['copies'], p['error'], p['name']) for p in points['outline']])
    outline.set(title='outline, against all silhouettes of a torus')
    outline.set_ylabel('1 - harmonic mean of precision and recall')
    for one in (bloom, outline):
        one.set(xlabel='full-screen copies', xlim=(0, None))
    for radius in sorted({p['radius'] for p in points['lens']}):
        curve = [p for p in points['lens'] if p['radius'] == radius]
        label = f'lens of radius {radius:g}'
        lens.plot([p['ms'] for p in curve], [p['psnr'] for p in curve], 'o-', label=label)
    lens.axhline(32, color='0.5', ls='--', label='bar')
    lens.set(xlabel='ms', ylabel='PSNR, dB', title='depth of field, against 256 pinholes')
    lens.legend(fontsize='x-small')
    save(figure, 'effects', results, path)


def _labelled(axes, points):
    axes.plot([p[0] for p in points], [p[1] for p in points], 'o')
    for x, y, name in points:
        place = {'xytext': (4, 3), 'textcoords': 'offset points', 'fontsize': 'xx-small'}
        axes.annotate(name, (x, y), **place)


def plot_figures(results, path):
    """Draw what a new pose costs by vertices, and the time of reaching against its error."""
    figure, (poses, reaching) = two_axes((13, 5.5))
    points = results.points['poses']
    for way in (name for name in points[0] if name != 'vertices'):
        poses.plot([p['vertices'] for p in points], [p[way] for p in points], 'o-', label=way)
    poses.set(xscale='log', yscale='log', xlabel='vertices', title='posing and upload')
    poses.set_ylabel('ms that a frame of a new pose takes longer')
    poses.legend(fontsize='x-small')
    for method, found in results.points['reaching'].items():
        reaching.plot(found['ms'], found['error'], 'o', ms=3, label=method)
    reaching.axhline(1e-3, color='0.5', ls='--', label='bar')
    reaching.axvline(2, color='0.5', ls='--')
    reaching.set(xscale='log', yscale='log', xlabel='ms', ylabel='error over reach')
    reaching.set_title('chains of 30 joints with limits')
    reaching.legend(fontsize='x-small')
    save(figure, 'figures', results, path)


def plot_clouds(results, path):
    """Draw the error of billboard clouds by planes, and by bytes beside quadric decimation."""
    meshes = results.points['meshes']
    figure, rows = several_axes((4 * len(meshes), 8), 2, len(meshes), squeeze=False)
    for name, planes, size in zip(meshes, *rows, strict=True):
        for way, points in meshes[name].items():
            points = sorted(points, key=lambda p: p['bytes'])
            error = [p['flip'] for p in points]
            if way != 'quadrics':
                planes.plot([p['planes'] for p in points], error, 'o-', label=way)
            if way != 'k-means':
                size.plot([p['bytes'] / 1e3 for p in points], error, 'o-', label=way)
        planes.set(xscale='log', xlabel='planes', title=name, ylim=(0, None))
        size.set(xscale='log', xlabel='kB', ylim=(0, None))
        for one in (planes, size):
            one.set_ylabel('mean FLIP against the mesh')
            one.legend(fontsize='x-small')
    save(figure, 'clouds', results, path)
