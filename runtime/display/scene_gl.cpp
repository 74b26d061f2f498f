// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/scene_gl.h"

#include <epoxy/gl.h>

#include <algorithm>

namespace sonocase::runtime::inline display {
namespace {

Matrix4 multiply(const Matrix4& a, const Matrix4& b) {
    Matrix4 c{};
    for (int col = 0; col < 4; ++col) {
        for (int row = 0; row < 4; ++row) {
            float sum = 0;
            for (int k = 0; k < 4; ++k) {
                sum += a[row + 4 * k] * b[k + 4 * col];
            }
            c[row + 4 * col] = sum;
        }
    }
    return c;
}

Matrix4 from_rigid(const Rigid& t) {
    Matrix4 m{};
    for (int c = 0; c < 3; ++c) {
        for (int r = 0; r < 3; ++r) {
            m[r + 4 * c] = static_cast<float>(t.rotation(r, c));
        }
        m[12 + c] = static_cast<float>(t.translation[c]);
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
    float light = 0.3 + 0.7 * (0.5 + 0.5 * dot(faceforward(n, -to_eye, n),
                                               normalize(vec3(-0.35, 0.75, 0.6))));
    if (mode == 1) {
        float rim = pow(1.0 - facing, 1.7);
        result = vec4(colour.rgb * (0.5 + 0.6 * light), min(colour.a + 0.72 * rim, 1.0));
    } else {
        vec3 h = normalize(to_eye + normalize(vec3(-0.35, 0.75, 0.6)));
        result = vec4(colour.rgb * light + 0.18 * pow(max(dot(n, h), 0.0), 24.0), colour.a);
    }
})";

GLuint compile(GLenum kind, const char* source) {
    const GLuint shader = glCreateShader(kind);
    glShaderSource(shader, 1, &source, nullptr);
    glCompileShader(shader);
    return shader;
}

}  // namespace

Matrix4 perspective(double tan_half, double aspect, double near, double far) {
    Matrix4 clip_from_view{};
    clip_from_view[0] = static_cast<float>(1 / (tan_half * aspect));
    clip_from_view[5] = static_cast<float>(1 / tan_half);
    clip_from_view[10] = static_cast<float>(-(far + near) / (far - near));
    clip_from_view[11] = -1;
    clip_from_view[14] = static_cast<float>(-2 * far * near / (far - near));
    return clip_from_view;
}

GlMesh::~GlMesh() {
    if (vertex_array_) glDeleteVertexArrays(1, &vertex_array_);
    if (vertices_) glDeleteBuffers(1, &vertices_);
    if (indices_) glDeleteBuffers(1, &indices_);
}

void GlMesh::upload(const Model& model) {
    if (vertex_array_ == 0) {
        glGenVertexArrays(1, &vertex_array_);
        glGenBuffers(1, &vertices_);
        glGenBuffers(1, &indices_);
    }
    glBindVertexArray(vertex_array_);
    glBindBuffer(GL_ARRAY_BUFFER, vertices_);
    glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(model.vertices.size() * sizeof(Vertex)),
                 model.vertices.data(), GL_STATIC_DRAW);
    glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_);
    glBufferData(GL_ELEMENT_ARRAY_BUFFER,
                 static_cast<GLsizeiptr>(model.indices.size() * sizeof(GLuint)),
                 model.indices.data(), GL_STATIC_DRAW);
    const auto offset = [](std::size_t bytes) { return reinterpret_cast<const void*>(bytes); };
    glVertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), offset(0));
    glVertexAttribPointer(1, 3, GL_FLOAT, GL_FALSE, sizeof(Vertex), offset(12));
    glVertexAttribPointer(2, 2, GL_FLOAT, GL_FALSE, sizeof(Vertex), offset(24));
    for (GLuint a = 0; a < 3; ++a) glEnableVertexAttribArray(a);
    glBindVertexArray(0);
    count_ = static_cast<int>(model.indices.size());
}

void GlMesh::draw() const {
    if (count_ == 0) return;
    glBindVertexArray(vertex_array_);
    glDrawElements(GL_TRIANGLES, count_, GL_UNSIGNED_INT, nullptr);
}

SceneProgram::SceneProgram() {
    const GLuint vertex = compile(GL_VERTEX_SHADER, kVertexShader);
    const GLuint fragment = compile(GL_FRAGMENT_SHADER, kFragmentShader);
    program_ = glCreateProgram();
    glAttachShader(program_, vertex);
    glAttachShader(program_, fragment);
    glLinkProgram(program_);
    glDeleteShader(vertex);
    glDeleteShader(fragment);
    clip_ = glGetUniformLocation(program_, "clip_from_model");
    view_ = glGetUniformLocation(program_, "view_from_model");
    colour_ = glGetUniformLocation(program_, "colour");
    mode_ = glGetUniformLocation(program_, "mode");
    image_ = glGetUniformLocation(program_, "image");
}

SceneProgram::~SceneProgram() {
    if (program_) glDeleteProgram(program_);
}

void SceneProgram::use(const Matrix4& clip_from_view,
                       const Rigid& view_from_mannequin,
                       unsigned texture) {
    clip_from_view_ = clip_from_view;
    view_from_mannequin_ = view_from_mannequin;
    glUseProgram(program_);
    glUniform1i(image_, 0);
    glActiveTexture(GL_TEXTURE0);
    glBindSampler(0, 0);
    glBindTexture(GL_TEXTURE_2D, texture);
}

void SceneProgram::draw(const GlMesh& mesh,
                        const Rigid& mannequin_from_model,
                        double scale,
                        unsigned rgb,
                        float alpha,
                        Paint paint) const {
    if (mesh.empty()) return;
    Matrix4 view = from_rigid(view_from_mannequin_ * mannequin_from_model);
    for (std::size_t i = 0; i < 12; ++i) view[i] *= static_cast<float>(i % 4 == 3 ? 1 : scale);
    const Matrix4 clip = multiply(clip_from_view_, view);
    glUniformMatrix4fv(clip_, 1, GL_FALSE, clip.data());
    glUniformMatrix4fv(view_, 1, GL_FALSE, view.data());
    glUniform4f(colour_, float((rgb >> 16) & 255) / 255, float((rgb >> 8) & 255) / 255,
                float(rgb & 255) / 255, alpha);
    glUniform1i(mode_, static_cast<int>(paint));
    mesh.draw();
}

void OffscreenPicture::resize(int width, int height) {
    if (width == width_px_ && height == height_px_) return;
    if (target_) glDeleteFramebuffers(1, &target_);
    if (resolved_) glDeleteFramebuffers(1, &resolved_);
    if (texture_) glDeleteTextures(1, &texture_);
    if (depth_) glDeleteRenderbuffers(1, &depth_);
    if (colours_) glDeleteRenderbuffers(1, &colours_);
    target_ = resolved_ = texture_ = depth_ = colours_ = 0;
    width_px_ = width;
    height_px_ = height;
    if (width <= 0 || height <= 0) return;
    GLint samples = 0;
    glGetIntegerv(GL_MAX_SAMPLES, &samples);
    samples = std::min(samples, 4);
    glGenTextures(1, &texture_);
    glBindTexture(GL_TEXTURE_2D, texture_);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
    glGenFramebuffers(1, &resolved_);
    glBindFramebuffer(GL_FRAMEBUFFER, resolved_);
    glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, texture_, 0);
    glGenFramebuffers(1, &target_);
    glBindFramebuffer(GL_FRAMEBUFFER, target_);
    glGenRenderbuffers(1, &colours_);
    glBindRenderbuffer(GL_RENDERBUFFER, colours_);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_RGBA8, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, colours_);
    glGenRenderbuffers(1, &depth_);
    glBindRenderbuffer(GL_RENDERBUFFER, depth_);
    glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_DEPTH_COMPONENT24, width, height);
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
}

void OffscreenPicture::begin() {
    glBindFramebuffer(GL_FRAMEBUFFER, target_);
    glViewport(0, 0, width_px_, height_px_);
    glDisable(GL_SCISSOR_TEST);
    glDisable(GL_CULL_FACE);
    glEnable(GL_DEPTH_TEST);
    glDepthMask(GL_TRUE);
    glDisable(GL_BLEND);
    glClearColor(0x10 / 255.0f, 0x11 / 255.0f, 0x12 / 255.0f, 1);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
}

void OffscreenPicture::end() {
    glDisable(GL_DEPTH_TEST);
    glBindVertexArray(0);
    glUseProgram(0);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, target_);
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, resolved_);
    glBlitFramebuffer(0, 0, width_px_, height_px_, 0, 0, width_px_, height_px_, GL_COLOR_BUFFER_BIT,
                      GL_NEAREST);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
}

void* OffscreenPicture::texture() const {
    return reinterpret_cast<void*>(static_cast<std::uintptr_t>(texture_));
}

}  // namespace sonocase::runtime::inline display
