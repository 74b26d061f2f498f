// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/view3d.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/display/shapes.h"
#include "runtime/display/skin_mesh.h"

namespace sonocase::runtime {
namespace {

struct Mesh {
    GLuint vertex_array = 0, vertices = 0, indices = 0;
    GLsizei count = 0;
};

// Column-major, as OpenGL wants it.
using Matrix4 = std::array<float, 16>;

Matrix4 multiply(const Matrix4& a, const Matrix4& b) {
    Matrix4 c{};
    for (int col = 0; col < 4; ++col) {
        for (int row = 0; row < 4; ++row) {
            float sum = 0;
            for (int k = 0; k < 4; ++k) {
                sum += a[static_cast<std::size_t>(row + 4 * k)] *
                       b[static_cast<std::size_t>(k + 4 * col)];
            }
            c[static_cast<std::size_t>(row + 4 * col)] = sum;
        }
    }
    return c;
}

Matrix4 from_rigid(const Rigid& t) {
    Matrix4 m{};
    for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r) {
            m[static_cast<std::size_t>(r + 4 * c)] = static_cast<float>(t.rotation(r, c));
        }
        m[static_cast<std::size_t>(12 + c)] = static_cast<float>(t.translation[c]);
    }
    m[15] = 1;
    return m;
}

const char* kVertexShader = R"(#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 texture_at;
uniform mat4 clip_from_model, view_from_model;
out vec3 view_normal; out vec3 view_position; out vec2 at;
void main() {
    gl_Position = clip_from_model * vec4(position, 1.0);
    view_normal = mat3(view_from_model) * normal;
    view_position = (view_from_model * vec4(position, 1.0)).xyz;
    at = texture_at;
})";

const char* kFragmentShader = R"(#version 330 core
in vec3 view_normal; in vec3 view_position; in vec2 at;
uniform vec4 colour;
uniform int mode;  // 0 lit, 1 skin, 2 textured, 3 flat
uniform sampler2D image;
out vec4 result;
void main() {
    if (mode == 3) { result = colour; return; }
    if (mode == 2) {
        float grey = texture(image, at).r;
        result = vec4(mix(vec3(0.03, 0.05, 0.07), vec3(1.0), grey), colour.a);
        return;
    }
    vec3 n = normalize(view_normal);
    vec3 to_eye = normalize(-view_position);
    float facing = abs(dot(n, to_eye));
    float light = 0.5 + 0.5 * abs(dot(n, normalize(vec3(0.35, 0.75, 0.6))));
    if (mode == 1) {
        float rim = pow(1.0 - facing, 2.0);
        result = vec4(colour.rgb * light + 0.25 * rim, mix(colour.a, 0.92, rim));
    } else {
        vec3 h = normalize(to_eye + normalize(vec3(0.35, 0.75, 0.6)));
        result = vec4(colour.rgb * light + 0.18 * pow(max(dot(n, h), 0.0), 24.0), colour.a);
    }
})";

GLuint compile(GLenum kind, const char* source) {
    const GLuint shader = glCreateShader(kind);
    glShaderSource(shader, 1, &source, nullptr);
    glCompileShader(shader);
    return shader;
}

void upload(Mesh& mesh,
            const std::vector<Vertex>& vertices,
            const std::vector<std::uint32_t>& indices) {
    if (mesh.vertex_array == 0) {
        glGenVertexArrays(1, &mesh.vertex_array);
        glGenBuffers(1, &mesh.vertices);
        glGenBuffers(1, &mesh.indices);
    }
    glBindVertexArray(mesh.vertex_array);
    glBindBuffer(GL_ARRAY_BUFFER, mesh.vertices);
    glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(vertices.size() * sizeof(Vertex)),
                 vertices.data(), GL_STATIC_DRAW);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, mesh.indices);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(indices.size() * sizeof(GLuint)),
                 indices.data(), GL_STATIC_DRAW);
    const auto offset = [](std::size_t bytes) { return reinterpret_cast<const void*>(bytes); };
    glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), offset(0));
    glVertexAttribPointer(1, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), offset(12));
    glVertexAttribPointer(2, 2, GL_FLOAT, GL_FALSE, sizeof(Vertex), offset(24));
    for (GLuint a = 0; a < 3; ++a) glEnableVertexAttribArray(a);
    glBindVertexArray(0);
    mesh.count = static_cast<GLsizei>(indices.size());
}

void free_mesh(Mesh& mesh) {
    if (mesh.vertex_array) glDeleteVertexArrays(1, &mesh.vertex_array);
    if (mesh.vertices) glDeleteBuffers(1, &mesh.vertices);
    if (mesh.indices) glDeleteBuffers(1, &mesh.indices);
    mesh = {};
}

}  // namespace

struct View3d::Impl {
    GLuint program = 0, target = 0, target_texture = 0, depth = 0, resolved = 0, colour_buffer = 0;
    GLint u_clip = -1, u_view = -1, u_colour = -1, u_mode = -1, u_image = -1;
    int width_px = 0, height_px = 0;
    Mesh skin, probe, mark, plane, needle, hub, ball;
    Exercise exercise;
    Box3 box;
    Point3 interest;
    Matrix3 home;  // columns: right, up, towards the eye
    Renderer::Layout plane_layout;
    bool plane_flipped = false;
    Matrix4 clip_from_view{};
    Rigid view_from_mannequin;
    double tan_half = 0.36;

    void resize(int width, int height);
    void build_probe();
    void build_plane(const View3dInput& input);
    void draw_mesh(const Mesh& mesh,
                   const Rigid& mannequin_from_model,
                   double scale,
                   unsigned rgb,
                   float alpha,
                   int mode);
};

View3d::View3d() : impl_(std::make_unique<Impl>()) {
    Impl& d = *impl_;
    const GLuint vertex = compile(GL_VERTEX_SHADER, kVertexShader);
    const GLuint fragment = compile(GL_FRAGMENT_SHADER, kFragmentShader);
    d.program = glCreateProgram();
    glAttachShader(d.program, vertex);
    glAttachShader(d.program, fragment);
    glLinkProgram(d.program);
    glDeleteShader(vertex);
    glDeleteShader(fragment);
    d.u_clip = glGetUniformLocation(d.program, "clip_from_model");
    d.u_view = glGetUniformLocation(d.program, "view_from_model");
    d.u_colour = glGetUniformLocation(d.program, "colour");
    d.u_mode = glGetUniformLocation(d.program, "mode");
    d.u_image = glGetUniformLocation(d.program, "image");
    std::vector<Vertex> vertices;
    std::vector<std::uint32_t> indices;
    sphere(vertices, indices);
    upload(d.ball, vertices, indices);
}

View3d::~View3d() {
    Impl& d = *impl_;
    for (Mesh* mesh : {&d.skin, &d.probe, &d.mark, &d.plane, &d.needle, &d.hub, &d.ball}) {
        free_mesh(*mesh);
    }
    d.resize(0, 0);
    if (d.program) glDeleteProgram(d.program);
}

void View3d::Impl::resize(int width, int height) {
    if (width == width_px && height == height_px) return;
    if (target) glDeleteFramebuffers(1, &target);
    if (resolved) glDeleteFramebuffers(1, &resolved);
    if (target_texture) glDeleteTextures(1, &target_texture);
    if (depth) glDeleteRenderbuffers(1, &depth);
    if (colour_buffer) glDeleteRenderbuffers(1, &colour_buffer);
    target = resolved = target_texture = depth = colour_buffer = 0;
    width_px = width;
    height_px = height;
    if (width <= 0 || height <= 0) return;
    GLint samples = 0;
    glGetIntegerv(GL_MAX_SAMPLES, &samples);
    samples = std::min(samples, 4);
    glGenTextures(1, &target_texture);
    glBindTexture(GL_TEXTURE_2D, target_texture);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
    glGenFramebuffers(1, &resolved);
    glBindFramebuffer(GL_FRAMEBUFFER, resolved);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, target_texture, 0);
    glGenFramebuffers(1, &target);
    glBindFramebuffer(GL_FRAMEBUFFER, target);
    glGenRenderbuffers(1, &colour_buffer);
    glBindRenderbuffer(GL_RENDERBUFFER, colour_buffer);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_RGBA8, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colour_buffer);
    glGenRenderbuffers(1, &depth);
    glBindRenderbuffer(GL_RENDERBUFFER, depth);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_DEPTH_COMPONENT24, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
}

void View3d::set_case(const CaseBundle& bundle) {
    Impl& d = *impl_;
    // 10 mm: some ten thousand triangles for a torso, and shoulders and breasts keep their shape.
    const Surface mesh = skin_mesh(bundle, 10);
    std::vector<Vertex> vertices;
    std::vector<std::uint32_t> indices;
    d.box = {};
    for (std::size_t i = 0; i < mesh.points.size(); ++i) {
        const Point3 p = mesh.points[i];
        const Vector3 n = mesh.normals[i];
        vertices.push_back(
            {{float(p.x), float(p.y), float(p.z)}, {float(n.x), float(n.y), float(n.z)}, {0, 0}});
        d.box.include(p);
    }
    for (const auto& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
    upload(d.skin, vertices, indices);
    if (d.box.empty()) d.box = bundle.grid.bounds();
}

void View3d::set_exercise(const Exercise& exercise) {
    Impl& d = *impl_;
    d.exercise = exercise;
    // The probe looks down in the picture, whatever the mannequin's axes are called; the body's
    // long axis runs across, as a patient lies before an operator.
    const Vector3 up = normalized(-exercise.start_beam);
    const Vector3 extent = d.box.extent();
    Vector3 along{1, 0, 0};
    if (extent.y > extent.x && extent.y >= extent.z) along = {0, 1, 0};
    if (extent.z > extent.x && extent.z > extent.y) along = {0, 0, 1};
    Vector3 right = along - dot(along, up) * up;
    right = norm(right) > 0.3 ? normalized(right) : any_perpendicular(up);
    d.home = Matrix3::from_columns(right, up, cross(right, up));
    d.interest = d.box.centre() + 0.3 * (exercise.start_probe - d.box.centre());
    orbit_ = {};
    orbit_.distance_mm = 1.4 * std::max({extent.x, extent.y, extent.z, 100.0});
    d.build_probe();
    d.plane_layout = {};

    std::vector<Vertex> vertices;
    std::vector<std::uint32_t> indices;
    const double length = std::max(exercise.needle.length_mm, 20.0);
    // Drawn thicker than life, or it would vanish at this size.
    loft({{-length, 1.1, 1.1}, {-4, 1.1, 1.1}, {0, 0.15, 0.15}}, 2, vertices, indices);
    upload(d.needle, vertices, indices);
    vertices.clear();
    indices.clear();
    loft({{-length - 32, 4, 4}, {-length - 30, 5.5, 5.5}, {-length - 6, 5, 5}, {-length, 2, 2}}, 2,
         vertices, indices);
    upload(d.hub, vertices, indices);
}

void View3d::Impl::build_probe() {
    const Probe& p = exercise.probe;
    double half = 0.5 * p.width_mm;
    if (p.shape == ProbeShape::curvilinear)
        half = p.radius_mm * std::sin(0.5 * p.field_of_view_rad);
    half = std::clamp(half, 8.0, 45.0) + 3;
    const double grip = std::clamp(0.55 * half, 9.0, 17.0);
    std::vector<Vertex> vertices;
    std::vector<std::uint32_t> indices;
    loft({{-158, 4, 4},
          {-132, 5, 5},
          {-128, grip - 4, 9},
          {-120, grip, 12},
          {-70, grip + 1, 13},
          {-42, 0.5 * (grip + half), 13},
          {-20, half, 12},
          {-5, half, 11},
          {-1, half - 2, 9}},
         2.8, vertices, indices);
    upload(probe, vertices, indices);
    vertices.clear();
    indices.clear();
    loft({{-46, 1.6, 2.4}, {-44, 2.4, 3.4}, {-30, 2.4, 3.4}, {-28, 1.6, 2.4}}, 2, vertices,
         indices);
    for (Vertex& v : vertices) v.position[0] += static_cast<float>(0.55 * (grip + half) + 1.5);
    upload(mark, vertices, indices);
}

void View3d::Impl::build_plane(const View3dInput& input) {
    const Probe& p = exercise.probe;
    constexpr int kSteps = 32;
    std::vector<Vertex> vertices;
    std::vector<std::uint32_t> indices;
    const double mm = input.layout.mm_per_px > 0 ? input.layout.mm_per_px : 0.3;
    for (int i = 0; i <= kSteps; ++i) {
        const double t = double(i) / kSteps - 0.5;
        for (int end = 0; end < 2; ++end) {
            double x = t * p.width_mm, z = end * (input.depth_mm > 0 ? input.depth_mm : p.depth_mm);
            if (p.shape != ProbeShape::linear) {
                const double angle = t * p.field_of_view_rad;
                const double radius = p.shape == ProbeShape::curvilinear ? p.radius_mm : 0;
                x = (radius + z) * std::sin(angle);
                z = (radius + z) * std::cos(angle) - radius;
            }
            const double u = (input.layout.origin_x_px + (input.flipped ? -x : x) / mm) /
                             std::max(input.image_width_px, 1);
            const double v =
                (input.layout.origin_y_px + z / mm) / std::max(input.image_height_px, 1);
            vertices.push_back({{float(x), 0, float(z)}, {0, 1, 0}, {float(u), float(v)}});
        }
    }
    for (GLuint i = 0; i < kSteps; ++i) {
        for (GLuint v : {2 * i, 2 * i + 1, 2 * i + 3, 2 * i, 2 * i + 3, 2 * i + 2})
            indices.push_back(v);
    }
    upload(plane, vertices, indices);
}

void View3d::Impl::draw_mesh(const Mesh& mesh,
                             const Rigid& mannequin_from_model,
                             double scale,
                             unsigned rgb,
                             float alpha,
                             int mode) {
    if (mesh.count == 0) return;
    Matrix4 view = from_rigid(view_from_mannequin * mannequin_from_model);
    for (std::size_t i = 0; i < 12; ++i) view[i] *= static_cast<float>(i % 4 == 3 ? 1 : scale);
    const Matrix4 clip = multiply(clip_from_view, view);
    glUniformMatrix4fv(u_clip, 1, GL_FALSE, clip.data());
    glUniformMatrix4fv(u_view, 1, GL_FALSE, view.data());
    glUniform4f(u_colour, float((rgb >> 16) & 255) / 255, float((rgb >> 8) & 255) / 255,
                float(rgb & 255) / 255, alpha);
    glUniform1i(u_mode, mode);
    glBindVertexArray(mesh.vertex_array);
    glDrawElements(GL_TRIANGLES, mesh.count, GL_UNSIGNED_INT, nullptr);
}

void* View3d::draw(int width_px, int height_px, const View3dInput& input) {
    Impl& d = *impl_;
    d.resize(std::max(width_px, 16), std::max(height_px, 16));
    if (d.plane_flipped != input.flipped || d.plane_layout.mm_per_px != input.layout.mm_per_px ||
        d.plane_layout.origin_y_px != input.layout.origin_y_px || d.plane.count == 0) {
        d.plane_layout = input.layout;
        d.plane_flipped = input.flipped;
        d.build_plane(input);
    }
    const bool from_probe = from_ == ViewFrom::probe && input.has_probe;
    const bool from_needle = from_ == ViewFrom::needle && input.has_needle;
    d.view_from_mannequin =
        inverse(from_probe    ? mannequin_from_probe_camera(input.mannequin_from_probe)
                : from_needle ? mannequin_from_needle_camera(input.mannequin_from_needle)
                              : mannequin_from_outside_camera(d.home, d.interest, orbit_));
    const double aspect = double(d.width_px) / d.height_px, near = 10, far = 5000;
    d.clip_from_view = {};
    d.clip_from_view[0] = static_cast<float>(1 / (d.tan_half * aspect));
    d.clip_from_view[5] = static_cast<float>(1 / d.tan_half);
    d.clip_from_view[10] = static_cast<float>(-(far + near) / (far - near));
    d.clip_from_view[11] = -1;
    d.clip_from_view[14] = static_cast<float>(-2 * far * near / (far - near));

    glBindFramebuffer(GL_FRAMEBUFFER, d.target);
    glViewport(0, 0, d.width_px, d.height_px);
    glDisable(GL_SCISSOR_TEST);
    glDisable(GL_CULL_FACE);
    glEnable(GL_DEPTH_TEST);
    glDepthMask(GL_TRUE);
    glClearColor(0.075f, 0.09f, 0.11f, 1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    glUseProgram(d.program);
    glUniform1i(d.u_image, 0);
    glActiveTexture(GL_TEXTURE0);
    glBindSampler(0, 0);
    glBindTexture(GL_TEXTURE_2D, input.image_texture);
    glDisable(GL_BLEND);

    const Rigid identity;
    if (input.has_probe) {
        if (!from_needle) {  // it would stand in the way
            d.draw_mesh(d.probe, input.mannequin_from_probe, 1, 0xD8DEE4, 1, 0);
            d.draw_mesh(d.mark, input.mannequin_from_probe, 1, 0x48BAD6, 1, 0);
        }
        d.draw_mesh(d.plane, input.mannequin_from_probe, 1, input.in_contact ? 0x6FB7CC : 0x39444E,
                    1, input.image_texture ? 2 : 3);
    }
    if (input.has_needle) {
        d.draw_mesh(d.needle, input.mannequin_from_needle, 1, 0xF2F4F6, 1, 0);
        d.draw_mesh(d.hub, input.mannequin_from_needle, 1, 0xE8904A, 1, 0);
    }
    if (input.show_targets) {
        for (std::size_t i = 0; i < d.exercise.targets.size(); ++i) {
            const Target& target = d.exercise.targets[i];
            Rigid place;
            const Point3 centre =
                i < input.target_centres.size() ? input.target_centres[i] : target.centre;
            place.translation = centre - Point3{};
            const bool hit = i < input.hit.size() && input.hit[i];
            d.draw_mesh(d.ball, place, std::max(target.radius_mm, 3.0), hit ? 0x60C882 : 0xFFC850,
                        1, 0);
        }
    }
    // The skin's front only, then blended over what is inside.
    glEnable(GL_CULL_FACE);
    glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    d.draw_mesh(d.skin, identity, 1, 0xC99A80, 0.3f, 3);
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glDepthFunc(GL_LEQUAL);
    glEnable(GL_BLEND);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    d.draw_mesh(d.skin, identity, 1, 0xE8C0A8, 0.42f, 1);
    glDisable(GL_CULL_FACE);
    glDepthFunc(GL_LESS);
    glDisable(GL_DEPTH_TEST);
    glBindVertexArray(0);
    glUseProgram(0);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, d.target);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, d.resolved);
    glBlitFramebuffer(0, 0, d.width_px, d.height_px, 0, 0, d.width_px, d.height_px,
                      GL_COLOR_BUFFER_BIT, GL_NEAREST);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    return reinterpret_cast<void*>(static_cast<std::uintptr_t>(d.target_texture));
}

ViewRay View3d::ray(double x_px, double y_px) const {
    const Impl& d = *impl_;
    const double aspect = double(d.width_px) / std::max(d.height_px, 1);
    const Vector3 direction_view{(2 * x_px / d.width_px - 1) * d.tan_half * aspect,
                                 (1 - 2 * y_px / d.height_px) * d.tan_half, -1};
    const Rigid mannequin_from_view = inverse(d.view_from_mannequin);
    return {mannequin_from_view * Point3{0, 0, 0},
            normalized(mannequin_from_view * direction_view)};
}

}  // namespace sonocase::runtime
