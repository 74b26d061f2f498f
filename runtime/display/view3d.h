// SPDX-License-Identifier: Apache-2.0

// The small 3-D view: translucent skin, probe, scan plane with the live picture on it, needle,
// targets. All calls belong to the thread of the window.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/display/camera.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

struct View3dInput {
    bool has_probe = false, has_needle = false, in_contact = true;
    Rigid mannequin_from_probe;
    Rigid mannequin_from_needle;
    Renderer::Layout layout;
    double depth_mm = 0;  // of the picture; may differ from the exercise's
    bool flipped = false;
    int image_width_px = 0, image_height_px = 0;
    unsigned image_texture = 0;  // OpenGL name; 0: a plain plane
    bool show_targets = true;
    std::vector<bool> targets_reached;  // # targets
    std::vector<Point3>
        target_centres;  // # targets, `mannequin` frame; empty: as the exercise has them
};

struct ViewRay {  // `mannequin` frame
    Point3 start;
    Vector3 direction;  // unit
};

class View3d {
  public:
    View3d();
    ~View3d();
    View3d(const View3d&) = delete;
    View3d& operator=(const View3d&) = delete;

    // A new skin. set_exercise() follows.
    void set_case(const CaseBundle& bundle);
    // New tools, and a new home view: the probe points down, the long axis of the body runs across.
    void set_exercise(const Exercise& exercise);
    Orbit& orbit() { return orbit_; }
    void home() { orbit_ = {}; }
    // Where to look from; from outside if the tool is not there.
    ViewFrom& from() { return from_; }

    // Draws at width x height pixels and returns the texture for ImGui::Image, whose v runs
    // upwards.
    void* draw(int width_px, int height_px, const View3dInput& input);
    // The ray through the pixel (x, y), from the top left, of the last picture.
    ViewRay ray(double x_px, double y_px) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
    Orbit orbit_;
    ViewFrom from_ = ViewFrom::outside;
};

}  // namespace sonocase::runtime
