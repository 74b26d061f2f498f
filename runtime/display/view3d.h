// SPDX-License-Identifier: Apache-2.0

// The 3-D view: translucent skin, organs and bones in their colours, probe, scan plane with the
// live picture on it, needle, targets. All calls belong to the thread of the window.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"
#include "runtime/display/models/camera.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline display {

struct View3dInput {
    bool has_probe = false, has_needle = false, in_contact = true;
    Rigid mannequin_from_probe;
    Rigid mannequin_from_needle;
    Renderer::Layout layout;
    double depth_mm = 0;  // depth of the picture; may differ from the exercise's
    bool flipped = false;
    int image_width_px = 0, image_height_px = 0;
    unsigned image_texture = 0;  // OpenGL name; 0: a plain plane
    bool show_targets = true;
    std::vector<bool> targets_reached;  // # targets
    // # targets, `mannequin` frame; empty: as the exercise has them.
    std::vector<Point3> target_centres;
    bool exam = false;         // the skin hides what is inside
    std::vector<Point3> path;  // the tip's path so far, `mannequin` frame; drawn as a line
    std::vector<Point3> best;  // the path to compare it with; drawn dotted
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

    // Makes a new skin; call set_exercise() next. Organs are made on a thread of their own, so that
    // the first picture does not wait. The bundle must live until leave_case() or the next case.
    void set_case(const CaseBundle& bundle);
    void leave_case();
    bool busy() const;  // organs are still being made
    bool& shows_organs() { return shows_organs_; }
    // Makes new tools and a new home view: the probe points down and the long axis of the body runs
    // across.
    void set_exercise(const Exercise& exercise);
    Orbit& orbit() { return orbit_; }
    void home() { orbit_ = first_; }
    // The orientation cube as it is seen in the last drawing of draw(); empty: the case's labels do
    // not say how the patient lies.
    std::vector<CubeFace> cube() const;
    // From outside, with that direction of the frame `mannequin` towards the eye.
    void look_at(Vector3 outward);
    // The viewpoint; the view is from outside while the tool is missing.
    ViewFrom& from() { return from_; }

    // Draws at width x height pixels and returns the texture for ImGui::Image, whose v runs
    // upwards.
    void* draw(int width_px, int height_px, const View3dInput& input);
    // Draws the same scene from the home view, for another display, into a texture of its own.
    // ray(), orbit() and from() stay as they are.
    void* draw_for_other(int width_px, int height_px, const View3dInput& input);
    // The ray through the pixel (x, y), from the top left, of the last picture.
    ViewRay ray(double x_px, double y_px) const;

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
    Orbit orbit_, first_;  // first_: home view of the exercise
    ViewFrom from_ = ViewFrom::outside;
    bool shows_organs_ = true;
};

}  // namespace sonocase::runtime::inline display
