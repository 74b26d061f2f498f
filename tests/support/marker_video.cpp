// SPDX-License-Identifier: Apache-2.0

#include "support/marker_video.h"

#include <algorithm>
#include <cmath>

#include "formats/base/constants.h"

namespace sonocase::testing {
namespace {

double patch(int x, int y, int salt) {
    return static_cast<double>(mix64(static_cast<std::uint64_t>(x) * 73856093u ^
                                     static_cast<std::uint64_t>(y) * 19349663u ^
                                     static_cast<std::uint64_t>(salt) * 83492791u) >>
                               40) /
           (1 << 24);
}

struct Face {
    Point3 origin;
    Vector3 x, y, out;
    double height = 0;  // of the plane over the origin of the body
    std::vector<Pixel> outline;
    double half_tag_mm = 0, cell_mm = 1;
    int id = -1;
};
std::vector<Face> faces_of(const MarkerBody& body) {
    std::vector<Face> faces;
    for (const MarkerFace& f : body.faces) {
        Face face;
        if (f.tag >= 0) {
            const MarkerTag& tag = body.tags[f.tag];
            face.origin = tag.body_from_tag * Point3{};
            face.x = tag.body_from_tag.rotation.column(0);
            face.y = tag.body_from_tag.rotation.column(1);
            face.id = tag.id;
            face.half_tag_mm = 0.5 * tag.edge_mm;
            face.cell_mm = tag.edge_mm / kTagCells;
        } else {
            face.origin = f.corners[0];
            face.x = normalized(f.corners[1] - f.corners[0]);
            face.y = normalized(cross(cross(face.x, f.corners[2] - f.corners[0]), face.x));
        }
        face.out = cross(face.x, face.y);
        face.height = dot(face.out, face.origin - Point3{});
        for (const Point3& c : f.corners)
            face.outline.push_back({dot(face.x, c - face.origin), dot(face.y, c - face.origin)});
        faces.push_back(face);
    }
    return faces;
}
// Where tags were glued askew faces cut each other.
bool is_convex(const MarkerBody& body) {
    for (const MarkerFace& face : body.faces) {
        const Vector3 out =
            normalized(cross(face.corners[1] - face.corners[0], face.corners[2] - face.corners[1]));
        for (const MarkerFace& other : body.faces)
            for (const Point3& corner : other.corners)
                if (dot(out, corner - face.corners[0]) > 1e-6) return false;
    }
    return true;
}
// Grey of the paper where a ray from `eye` along `ray`, in the frame of the body, meets it;
// negative: nowhere. The order of the faces does not matter for a convex body: the one that was
// met last is tried first. Of another the nearest face counts.
double cast(const std::vector<Face>& faces,
            bool convex,
            std::size_t& last,
            Point3 eye,
            Vector3 ray,
            Vector3 light) {
    double nearest = 1e9, grey = -1;
    for (std::size_t turn = 0; turn <= faces.size(); ++turn) {
        const std::size_t index = turn == 0 ? last : turn - 1;
        if (turn > 0 && index == last) continue;
        const Face& face = faces[index];
        const double slope = dot(face.out, ray);
        if (slope >= 0) continue;
        const double t = (face.height - dot(face.out, eye - Point3{})) / slope;
        if (t <= 0 || t >= nearest) continue;
        const Vector3 at = eye + t * ray - face.origin;
        const double u = dot(face.x, at), v = dot(face.y, at);
        bool within = true;
        for (std::size_t k = 0; k < face.outline.size() && within; ++k) {
            const Pixel a = face.outline[k], b = face.outline[(k + 1) % face.outline.size()];
            within = (b.x - a.x) * (v - a.y) - (b.y - a.y) * (u - a.x) >= 0;
        }
        if (!within) continue;
        last = index;
        const double shade = 0.6 + 0.4 * std::max(0.0, dot(face.out, light));
        bool white = true;
        if (face.id >= 0 && std::abs(u) < face.half_tag_mm && std::abs(v) < face.half_tag_mm) {
            const int column = static_cast<int>((u + face.half_tag_mm) / face.cell_mm);
            const int row = static_cast<int>((face.half_tag_mm - v) / face.cell_mm);
            white = tag_cell_is_white(face.id, row, column);
        }
        grey = shade * (white ? 215 : 35);
        nearest = t;
        if (convex) break;
    }
    return grey;
}

void blur(std::vector<float>& part, int w, int h, double sigma) {
    if (!(sigma > 0.05)) return;
    const int reach = static_cast<int>(3 * sigma + 1);
    std::vector<float> kernel(2 * reach + 1);
    float sum = 0;
    for (int k = -reach; k <= reach; ++k)
        sum += kernel[k + reach] = static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma)));
    for (float& k : kernel) k /= sum;
    std::vector<float> once(part.size());
    for (int pass = 0; pass < 2; ++pass) {
        for (int y = 0; y < h; ++y)
            for (int x = 0; x < w; ++x) {
                float total = 0;
                for (int k = -reach; k <= reach; ++k) {
                    const int xx = pass == 0 ? std::clamp(x + k, 0, w - 1) : x;
                    const int yy = pass == 1 ? std::clamp(y + k, 0, h - 1) : y;
                    total += kernel[k + reach] * part[static_cast<std::size_t>(yy) * w + xx];
                }
                once[static_cast<std::size_t>(y) * w + x] = total;
            }
        part.swap(once);
    }
}

}  // namespace

MarkerVideo::MarkerVideo(const CameraModel& camera, std::uint64_t seed)
    : camera_(camera), random_(seed), noise_(1 << 16) {
    const int w = camera.width_px, h = camera.height_px;
    rays_.resize(static_cast<std::size_t>(w + 1) * (h + 1));
    for (int y = 0; y <= h; ++y)
        for (int x = 0; x <= w; ++x)
            rays_[static_cast<std::size_t>(y) * (w + 1) + x] =
                direction_at(camera, {x - 0.5, y - 0.5});
    ground_.resize(static_cast<std::size_t>(w) * h);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x) {
            // Cloth: patches of three sizes.
            double grey = 95;
            for (const int size : {48, 12, 3})
                grey += 14 * (2 * patch(x / size, y / size, size) - 1);
            ground_[static_cast<std::size_t>(y) * w + x] = static_cast<float>(grey);
        }
    for (float& n : noise_) {
        double sum = 0;
        for (int k = 0; k < 12; ++k) sum += random_.unit();
        n = static_cast<float>(sum - 6);
    }
}

std::vector<std::uint8_t> MarkerVideo::take(const std::vector<PlacedBody>& bodies,
                                            double time_s,
                                            const VideoOptions& options) {
    const int w = camera_.width_px, h = camera_.height_px;
    std::vector<float> picture =
        options.ground ? ground_ : std::vector<float>(static_cast<std::size_t>(w) * h, 60.f);
    for (const PlacedBody& placed : bodies) paint(placed, time_s, options, picture);
    std::vector<std::uint8_t> out(picture.size());
    for (int y = 0; y < h; ++y) {
        const double row_s = time_s + options.readout_s * (static_cast<double>(y) / h - 0.5);
        const double light =
            options.brightness * (1 + options.flicker * std::sin(2 * kPi * 100 * row_s));
        std::size_t from = random_.below(noise_.size() - w);
        const float amplitude = static_cast<float>(options.noise_grey);
        for (int x = 0; x < w; ++x) {
            const std::size_t at = static_cast<std::size_t>(y) * w + x;
            const float grey = picture[at] * static_cast<float>(light) + amplitude * noise_[from++];
            out[options.mirrored ? static_cast<std::size_t>(y) * w + (w - 1 - x) : at] =
                static_cast<std::uint8_t>(std::clamp(grey + 0.5f, 0.f, 255.f));
        }
    }
    return out;
}

void MarkerVideo::paint(const PlacedBody& placed,
                        double time_s,
                        const VideoOptions& options,
                        std::vector<float>& picture) {
    constexpr int kAcross = 4, kSamples = kAcross * kAcross;
    const int w = camera_.width_px, h = camera_.height_px;
    const std::vector<Face> faces = faces_of(*placed.body);
    const bool convex = is_convex(*placed.body);
    const double span_s = 0.5 * (options.exposure_s + options.readout_s);
    double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9;
    for (const double t : {time_s - span_s, time_s, time_s + span_s})
        for (const MarkerFace& f : placed.body->faces)
            for (const Point3& c : f.corners) {
                Pixel p;
                const Point3 at = placed.pose(t) * c;
                if (!project(camera_, at - Point3{}, p, nullptr)) return;
                x0 = std::min(x0, p.x), x1 = std::max(x1, p.x);
                y0 = std::min(y0, p.y), y1 = std::max(y1, p.y);
            }
    const int margin = 3 + static_cast<int>(3 * options.defocus_px);
    const int left = std::max(0, static_cast<int>(x0) - margin);
    const int right = std::min(w - 1, static_cast<int>(x1) + margin);
    const int top = std::max(0, static_cast<int>(y0) - margin);
    const int bottom = std::min(h - 1, static_cast<int>(y1) + margin);
    if (left >= right || top >= bottom) return;
    const int rw = right - left + 1, rh = bottom - top + 1;
    std::vector<float> part(static_cast<std::size_t>(rw) * rh);
    const Vector3 light_camera = normalized({0.4, -0.7, -0.6});
    struct Eye {
        Matrix3 body_from_camera;
        Point3 at;
        Vector3 light;
    };
    std::vector<Eye> eyes(kSamples);
    std::size_t last = 0;
    for (int y = 0; y < rh; ++y) {
        const double row_s = time_s + options.readout_s * (static_cast<double>(y + top) / h - 0.5);
        if (y == 0 || options.readout_s > 0 || options.exposure_s > 0) {
            for (int k = 0; k < kSamples; ++k) {
                const Rigid body_from_camera =
                    inverse(placed.pose(row_s + options.exposure_s * ((k + 0.5) / kSamples - 0.5)));
                eyes[k] = {body_from_camera.rotation, body_from_camera * Point3{},
                           body_from_camera * light_camera};
            }
        }
        for (int x = 0; x < rw; ++x) {
            const std::size_t corner = static_cast<std::size_t>(y + top) * (w + 1) + x + left;
            const Vector3 a = rays_[corner], b = rays_[corner + 1];
            const Vector3 c = rays_[corner + w + 1], d = rays_[corner + w + 2];
            const float under = picture[static_cast<std::size_t>(y + top) * w + x + left];
            double sum = 0;
            const int shift = static_cast<int>(mix64(x * 8191u + y) & (kSamples - 1));
            for (int k = 0; k < kSamples; ++k) {
                const double fx = (k % kAcross + 0.5) / kAcross;
                const double fy = (k / kAcross + 0.5) / kAcross;
                const Vector3 ray =
                    (1 - fy) * ((1 - fx) * a + fx * b) + fy * ((1 - fx) * c + fx * d);
                const Eye& eye = eyes[(k * 5 + shift) & (kSamples - 1)];
                const double grey =
                    cast(faces, convex, last, eye.at, eye.body_from_camera * ray, eye.light);
                sum += grey < 0 ? under : grey;
            }
            part[static_cast<std::size_t>(y) * rw + x] = static_cast<float>(sum / kSamples);
        }
    }
    blur(part, rw, rh, options.defocus_px);
    for (int y = 0; y < rh; ++y)
        std::copy(part.begin() + static_cast<std::ptrdiff_t>(y) * rw,
                  part.begin() + static_cast<std::ptrdiff_t>(y + 1) * rw,
                  picture.begin() + static_cast<std::ptrdiff_t>(y + top) * w + left);
}

}  // namespace sonocase::testing
