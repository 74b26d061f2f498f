// SPDX-License-Identifier: Apache-2.0

// Paints a 2-D scene of VTK on a canvas. Internal to pipeline/pictures.
#pragma once

#include "pipeline/pictures/canvas.h"

class vtkContextScene;

namespace sonocase::pipeline {

// Where on the canvas a scene is painted: pixels, y up.
struct SceneArea {
    double left_px = 0, bottom_px = 0;
    int width_px = 0, height_px = 0;
};

// Lines, marks, fills, text and clipping; ellipses, images and textures are not drawn. The scene's
// geometry must be set to the area's size.
void paint_scene(vtkContextScene& scene, Canvas& canvas, const SceneArea& area);

}  // namespace sonocase::pipeline
