// SPDX-License-Identifier: Apache-2.0

// Draws the sheets of README.md, docs/realism.md and docs/effects.md from a bundle of
// scenarios/real-torso:
//   sonocase_pictures BUNDLE FOLDER
// writes FOLDER/readme.png, FOLDER/realism.png and FOLDER/effects/press-series.png; the pictures of
// single effects are drawn by docs/examples/effects. Views are named by anatomy, so that another
// cooking of the case shows the same.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>

#include "formats/bundle/case_bundle.h"
#include "formats/files/load_save.h"
#include "runtime/imaging/renderer.h"
#include "runtime/player/session/png_file.h"

namespace sonocase {
namespace {

using runtime::ImageModel;

// Directions along head, left and front of the patient.
struct View {
    const char *name, *label;  // aimed at the middle of this label
    Vector3 from;              // where the probe is, seen from there
    Vector3 lateral;
    bool linear;
    double depth_mm;
    Vector3 aside_mm{};  // the aim moved, same axes
};

const View kViews[] = {
    {"liver", "liver", {-0.1, -0.75, 0.65}, {0, 1, 0}, false, 150, {-15, 0, 0}},
    {"kidney", "kidney_right", {0, -0.9, 0.35}, {1, 0, 0}, false, 150},
    {"aorta", "aorta", {0, 0.05, 1}, {0, 1, 0}, false, 150, {-20, 0, 0}},
    {"gas", "colon", {0, 0.3, 1}, {0, 1, 0}, false, 150, {20, 0, 0}},
    {"bladder", "urinary_bladder", {0.25, 0, 1}, {1, 0, 0}, false, 180},
    {"rib", "rib_right_9", {0, -1, 0.2}, {1, 0, 0.1}, true, 50},
    {"muscle", "autochthon_right", {0, -0.1, -1}, {1, 0, 0}, true, 50},
    {"vessel", "iliac_artery_left", {-0.3, 0.1, 1}, {0, 1, 0}, true, 60, {-74, 28, 16}},
};

struct Body {
    const CaseBundle& bundle;
    std::map<std::string, Point3> middle;
    Vector3 head, left, front;

    explicit Body(const CaseBundle& b) : bundle(b) {
        std::vector<Vector3> sum(b.labels.size());
        std::vector<double> count(b.labels.size(), 0.0);
        for (int k = 0; k < b.grid.size.z; k += 2) {
            for (int j = 0; j < b.grid.size.y; j += 2) {
                for (int i = 0; i < b.grid.size.x; i += 2) {
                    const std::size_t l = b.label_bricks.at(i, j, k);
                    sum[l] = sum[l] + Vector3{1.0 * i, 1.0 * j, 1.0 * k};
                    ++count[l];
                }
            }
        }
        for (std::size_t l = 1; l < count.size(); ++l) {
            const Vector3 v = sum[l] / std::max(count[l], 1.0);
            middle[b.labels[l].name] = b.grid.point_from_voxel({v.x, v.y, v.z});
        }
        head = normalized(middle["vertebrae_T12"] - middle["vertebrae_L5"]);
        const Vector3 across = middle["kidney_left"] - middle["kidney_right"];
        left = normalized(across - dot(across, head) * head);
        front = cross(left, head);
        if (dot(front, middle["urinary_bladder"] - middle["sacrum"]) < 0) front = -1.0 * front;
    }

    Vector3 direction(Vector3 v) const { return normalized(v.x * head + v.y * left + v.z * front); }

    // The probe pressed on the skin.
    Rigid pose(const View& view) const {
        const Vector3 out = direction(view.from), beam = -1.0 * out;
        const Point3 aim = middle.at(view.label) + view.aside_mm.x * head + view.aside_mm.y * left +
                           view.aside_mm.z * front;
        Point3 face = aim;
        for (double s = 300; s > 0; s -= 0.5) {
            const Point3 v = bundle.grid.voxel_from_point(aim + s * out);
            const Int3 i{static_cast<int>(std::lround(v.x)), static_cast<int>(std::lround(v.y)),
                         static_cast<int>(std::lround(v.z))};
            if (!bundle.grid.contains(i.x, i.y, i.z) || bundle.label_bricks.at(i.x, i.y, i.z) == 0)
                continue;
            face = aim + (s - (view.linear ? 1.0 : 4.0)) * out;
            break;
        }
        const Vector3 wish = direction(view.lateral);
        const Vector3 x = normalized(wish - dot(wish, beam) * beam);
        return {Matrix3::from_columns(x, cross(beam, x), beam), {face.x, face.y, face.z}};
    }
};

struct Picture {
    int width = 0, height = 0;
    std::vector<std::uint8_t> pixels;
    Picture(int w, int h, std::uint8_t grey = 0)
        : width(w),
          height(h),
          pixels(static_cast<std::size_t>(w) * static_cast<std::size_t>(h), grey) {}
    void put(const Picture& p, int x, int y) {
        for (int row = 0; row < p.height; ++row)
            std::copy_n(p.pixels.begin() + row * p.width, p.width,
                        pixels.begin() + (y + row) * width + x);
    }
};

Picture draw(const Body& body,
             const char* name,
             ImageModel model,
             int width,
             int height,
             double press_mm = 0) {
    const View* view = kViews;
    for (const View& v : kViews)
        if (std::string(v.name) == name) view = &v;
    Exercise e;
    e.name = name;
    e.probe.depth_mm = view->depth_mm;
    if (view->linear) {
        e.probe.shape = ProbeShape::linear;
        e.probe.width_mm = 40;
        e.probe.frequency_mhz = 8;
        e.probe.focus_mm = 25;
        e.probe.elevation_mm = 2;
    }
    const Rigid pose = body.pose(*view);
    e.start_probe = Point3{} + pose.translation;  // what the opening gain is worked out from
    e.start_beam = pose.rotation.column(2);
    runtime::FrameInput input;
    input.mannequin_from_probe = pose;
    input.frame = 3;
    input.settings.press_mm = press_mm;
    runtime::RenderOptions o;
    o.model = model;
    o.width_px = width;
    o.height_px = height;
    Picture p(width, height);
    runtime::Renderer::create(body.bundle, e, o)->render(input, p.pixels);
    return p;
}

bool save(const std::string& path, const Picture& p) {
    const Status saved = runtime::write_png(path, p.width, p.height, 1, p.pixels);
    if (!saved) std::fprintf(stderr, "%s\n", saved.error().message().c_str());
    return saved.has_value();
}

// The femoral vessels under a probe that presses more and more, in both models.
bool press_series(const Body& body, const std::string& path) {
    constexpr int kWidth = 240, kHeight = 330, kGap = 4;
    const std::vector<double> depths_mm{0, 4, 8, 12, 18};
    Picture row(static_cast<int>(depths_mm.size()) * (kWidth + kGap) - kGap, 2 * kHeight + kGap,
                90);
    int at = 0;
    for (const double press_mm : depths_mm) {
        const int x = at++ * (kWidth + kGap);
        const auto vessel = [&](ImageModel model) {
            return draw(body, "vessel", model, kWidth, kHeight, press_mm);
        };
        row.put(vessel(ImageModel::physical), x, 0);
        row.put(vessel(ImageModel::paper), x, kHeight + kGap);
    }
    return save(path, row);
}

// Four views a row, the first `physical` rows in that model.
bool sheet_of(const Body& body,
              const std::vector<std::vector<const char*>>& rows,
              std::size_t physical,
              const std::string& path) {
    constexpr int kWidth = 440, kHeight = 400, kGap = 6;
    const int height = static_cast<int>(rows.size()) * (kHeight + kGap) - kGap;
    Picture sheet(4 * (kWidth + kGap) - kGap, height, 40);
    for (std::size_t row = 0; row < rows.size(); ++row) {
        for (std::size_t i = 0; i < rows[row].size(); ++i) {
            const auto model = row < physical ? ImageModel::physical : ImageModel::paper;
            sheet.put(draw(body, rows[row][i], model, kWidth, kHeight),
                      static_cast<int>(i) * (kWidth + kGap),
                      static_cast<int>(row) * (kHeight + kGap));
        }
    }
    return save(path, sheet);
}

int run(const std::string& path, const std::string& folder) {
    const Result<CaseBundle> bundle = load_bundle(path);
    if (!bundle) {
        std::fprintf(stderr, "%s\n", bundle.error().message().c_str());
        return 1;
    }
    std::filesystem::create_directories(folder + "/effects");
    const Body body(*bundle);
    for (const View& v : kViews) {
        if (body.middle.count(v.label) == 0) {
            std::fprintf(stderr, "%s: no label %s; give a bundle of scenarios/real-torso\n",
                         path.c_str(), v.label);
            return 1;
        }
    }
    const std::vector<const char*> fan{"liver", "kidney", "aorta", "gas"},
        linear{"bladder", "rib", "muscle", "vessel"}, paper{"kidney", "aorta", "bladder", "muscle"};
    return press_series(body, folder + "/effects/press-series.png") &&
                   sheet_of(body, {fan, linear, paper}, 2, folder + "/realism.png") &&
                   sheet_of(body, {fan, linear}, 2, folder + "/readme.png")
               ? 0
               : 1;
}

}  // namespace
}  // namespace sonocase

int main(int argc, char** argv) {
    if (argc != 3) {
        std::fprintf(stderr, "sonocase_pictures BUNDLE FOLDER\n");
        return 2;
    }
    return sonocase::run(argv[1], argv[2]);
}
