"""
Without PyVista's plotter
=========================

``pvibr.attach`` gives a plain ``vtkRenderer`` what plotters have as ``pl.ibr``: for VTK scripts,
Qt windows and trame applications.
"""

import numpy as np
import pyvista as pv
import vtk

import pvibr

COUNT = 5_000

# %%
# 1. A window as VTK programs make it.
renderer = vtk.vtkRenderer()
renderer.SetBackground(0.1, 0.12, 0.16)
window = vtk.vtkRenderWindow()
window.SetOffScreenRendering(pv.OFF_SCREEN)
window.SetSize(960, 540)
window.AddRenderer(renderer)

# %%
# 2. An actor with its looks, and where to draw it.
source = vtk.vtkSuperquadricSource(toroidal=True, phi_resolution=48, theta_resolution=48)
mapper = vtk.vtkPolyDataMapper(input_connection=source.output_port)
actor = vtk.vtkActor(mapper=mapper)
actor.property.color = (0.9, 0.6, 0.2)
places = np.random.default_rng(3).uniform(-15, 15, (COUNT, 3))

# %%
# 3. The instances. As a context manager it frees what it holds on the GPU before the window
# goes.
with pvibr.attach(renderer) as ibr:
    ibr.add_instances(actor, places, max_error=1.0)
    renderer.ResetCamera()
    camera = renderer.GetActiveCamera()
    camera.Azimuth(30)
    camera.Elevation(40)
    camera.Zoom(1.6)
    window.Render()
    print(ibr.report())

    # %%
    # 4. A picture, or a window to turn it in.
    grab = vtk.vtkWindowToImageFilter(input=window, read_front_buffer=False)
    grab.Update()
    picture = pv.wrap(grab.GetOutput())
    if not pv.OFF_SCREEN:
        interactor = vtk.vtkRenderWindowInteractor(render_window=window)
        interactor.Start()
