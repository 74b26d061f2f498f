// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/body_axes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

namespace sonocase {
namespace {

constexpr double kStepMm = 8;

struct Cloud {
    Vector3 sum;
    double count = 0;
    double top = -std::numeric_limits<double>::infinity();

    void add(const Cloud& other) {
        sum = sum + other.sum;
        count += other.count;
    }
    Vector3 mean() const { return (1 / std::max(count, 1.0)) * sum; }
};

bool has_part(const std::string& name, std::string_view part) {
    return name.find(part) != std::string::npos;
}

// Order of a vertebra from the tail: S1 is 1, L5 2, ..., C1 25; 0: none.
int order_of(const std::string& name) {
    if (name.rfind("vertebrae_", 0) != 0 || name.size() < 12) return 0;
    const char region = name[10];
    const int number = std::atoi(name.c_str() + 11);
    return region == 'S'   ? 2 - number
           : region == 'L' ? 7 - number
           : region == 'T' ? 19 - number
           : region == 'C' ? 26 - number
                           : 0;
}

// One cloud per label of the palette.
std::vector<Cloud> clouds_of(const CaseBundle& bundle) {
    std::vector<Cloud> clouds(std::max<std::size_t>(bundle.labels.size(), 256));
    const Grid& grid = bundle.grid;
    const int step = std::max(1, static_cast<int>(std::lround(kStepMm / grid.spacing_mm.x)));
    for (int k = step / 2; k < grid.size.z; k += step)
        for (int j = step / 2; j < grid.size.y; j += step)
            for (int i = step / 2; i < grid.size.x; i += step) {
                Cloud& cloud = clouds[bundle.label_bricks.at(i, j, k)];
                const Point3 p = grid.point_from_voxel({double(i), double(j), double(k)});
                cloud.sum = cloud.sum + (p - Point3{});
                cloud.count += 1;
            }
    return clouds;
}

// From the pelvis to the head; zero: unknown.
Vector3 head_of(const CaseBundle& bundle, const std::vector<Cloud>& clouds) {
    int lowest = 0, highest = 0;
    Vector3 low, high;
    Cloud upper, lower;
    constexpr std::array<std::string_view, 8> kUpper{
        "lung", "liver", "spleen", "heart", "stomach", "pancreas", "kidney", "gallbladder"};
    constexpr std::array<std::string_view, 7> kLower{
        "urinary_bladder", "prostate", "uterus", "femur", "hip_", "iliac_", "rectum"};
    for (std::size_t l = 1; l < bundle.labels.size(); ++l) {
        if (clouds[l].count == 0) continue;
        const std::string& name = bundle.labels[l].name;
        if (const int order = order_of(name); order > 0) {
            if (lowest == 0 || order < lowest) lowest = order, low = clouds[l].mean();
            if (order > highest) highest = order, high = clouds[l].mean();
        }
        const auto named = [&](std::string_view part) { return has_part(name, part); };
        if (std::any_of(kLower.begin(), kLower.end(), named)) {
            lower.add(clouds[l]);
        } else if (std::any_of(kUpper.begin(), kUpper.end(), named)) {
            upper.add(clouds[l]);
        }
    }
    if (highest > lowest) return high - low;
    return upper.count > 0 && lower.count > 0 ? upper.mean() - lower.mean() : Vector3{};
}

// From the left to the right; zero: unknown.
Vector3 right_of(const CaseBundle& bundle, const std::vector<Cloud>& clouds) {
    Cloud right, left, liver, spleen;
    for (std::size_t l = 1; l < bundle.labels.size(); ++l) {
        const std::string& name = bundle.labels[l].name;
        if (name == "liver") liver = clouds[l];
        if (name == "spleen") spleen = clouds[l];
        const std::size_t at = name.find("_right");
        if (at == std::string::npos || clouds[l].count == 0) continue;
        std::string other = name;
        other.replace(at, 6, "_left");
        for (std::size_t k = 1; k < bundle.labels.size(); ++k) {
            if (bundle.labels[k].name != other || clouds[k].count == 0) continue;
            // A pair counts once, whatever its size.
            right.sum = right.sum + clouds[l].mean();
            left.sum = left.sum + clouds[k].mean();
            right.count = left.count = right.count + 1;
        }
    }
    if (right.count > 0) return right.mean() - left.mean();
    return liver.count > 0 && spleen.count > 0 ? liver.mean() - spleen.mean() : Vector3{};
}

}  // namespace

BodyAxes body_axes(const CaseBundle& bundle) {
    constexpr double kMinMm = 5;  // nearer centres say nothing
    BodyAxes axes;
    if (bundle.label_bricks.table.empty()) return axes;
    const std::vector<Cloud> clouds = clouds_of(bundle);
    const Vector3 head = head_of(bundle, clouds);
    if (norm(head) < kMinMm) return axes;
    const Vector3 up = normalized(head);
    const Vector3 across = right_of(bundle, clouds);
    const Vector3 right = across - dot(across, up) * up;
    if (norm(right) < kMinMm) return axes;
    axes.known = true;
    axes.head = up;
    axes.right = normalized(right);
    axes.front = cross(axes.head, axes.right);
    const Grid& grid = bundle.grid;
    std::vector<char> femur(256, 0);
    for (std::size_t l = 1; l < std::min<std::size_t>(bundle.labels.size(), 256); ++l)
        femur[l] = has_part(bundle.labels[l].name, "femur");
    const int step = std::max(1, static_cast<int>(std::lround(0.5 * kStepMm / grid.spacing_mm.x)));
    for (int k = 0; k < grid.size.z; k += step)
        for (int j = 0; j < grid.size.y; j += step)
            for (int i = 0; i < grid.size.x; i += step)
                if (femur[bundle.label_bricks.at(i, j, k)])
                    axes.groin_mm = std::max(
                        axes.groin_mm,
                        dot(grid.point_from_voxel({double(i), double(j), double(k)}) - Point3{},
                            axes.head));
    return axes;
}

std::string label_at(const BodyAxes& axes, const std::string& label, Point3 rest) {
    const bool vein = label.rfind("iliac_vena", 0) == 0 || label.rfind("iliac_vein", 0) == 0;
    const bool artery = label.rfind("iliac_artery", 0) == 0;
    if ((!vein && !artery) || !axes.known || dot(rest - Point3{}, axes.head) > axes.groin_mm)
        return label;
    const char* end = has_part(label, "_right")  ? "_right"
                      : has_part(label, "_left") ? "_left"
                                                 : "";
    return std::string(vein ? "common_femoral_vein" : "common_femoral_artery") + end;
}

}  // namespace sonocase
