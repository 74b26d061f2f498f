// SPDX-License-Identifier: Apache-2.0

// OpenGL 3.3 behind the 3-D view: meshes on the graphics card, the program that draws them, and the
// texture that it draws into. OpenGL's own types stay in the .cpp file; all calls belong to the
// thread of the window.
#pragma once

#include <array>

#include "formats/base/geometry.h"
#include "runtime/display/models/tool_models.h"

namespace sonocase::runtime::inline display {

// Column-major, as OpenGL takes it.
using Matrix4 = std::array<float, 16>;
// tan_half: tangent of half the vertical field of view; near, far: distances in mm.
Matrix4 perspective(double tan_half, double aspect, double near, double far);

class GlMesh {
  public:
    GlMesh() = default;
    ~GlMesh();
    GlMesh(const GlMesh&) = delete;
    GlMesh& operator=(const GlMesh&) = delete;

    void upload(const Model& model);
    bool empty() const { return count_ == 0; }
    void draw() const;

  private:
    unsigned vertex_array_ = 0, vertices_ = 0, indices_ = 0;
    int count_ = 0;
};

// How a mesh is painted.
enum class Paint : int { lit = 0, skin = 1, textured = 2, flat = 3 };

// Compiled shaders. use() before draw().
class SceneProgram {
  public:
    SceneProgram();
    ~SceneProgram();
    SceneProgram(const SceneProgram&) = delete;
    SceneProgram& operator=(const SceneProgram&) = delete;

    // texture: OpenGL name of the picture for Paint::textured; 0: none.
    void use(const Matrix4& clip_from_view, const Rigid& view_from_mannequin, unsigned texture);
    // rgb: 0xRRGGBB. scale: enlarges the mesh about its origin.
    void draw(const GlMesh& mesh,
              const Rigid& mannequin_from_model,
              double scale,
              unsigned rgb,
              float alpha,
              Paint paint) const;

  private:
    unsigned program_ = 0;
    int clip_ = -1, view_ = -1, colour_ = -1, mode_ = -1, image_ = -1;  // uniforms
    Matrix4 clip_from_view_{};
    Rigid view_from_mannequin_;
};

// A multisampled picture and the texture that it is resolved into.
class OffscreenPicture {
  public:
    OffscreenPicture() = default;
    ~OffscreenPicture() { resize(0, 0); }
    OffscreenPicture(const OffscreenPicture&) = delete;
    OffscreenPicture& operator=(const OffscreenPicture&) = delete;

    void resize(int width_px, int height_px);
    int width_px() const { return width_px_; }
    int height_px() const { return height_px_; }
    // What is drawn between the two goes to the picture. begin() clears it and turns the depth test
    // on and blending off.
    void begin();
    void end();
    void* texture() const;  // for ImGui

  private:
    unsigned target_ = 0, texture_ = 0, depth_ = 0, resolved_ = 0, colours_ = 0;
    int width_px_ = 0, height_px_ = 0;
};

}  // namespace sonocase::runtime::inline display
