// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <string>

#include "pipeline/import/body/body_field.h"

namespace sonocase::pipeline {
namespace {

// Above the armpits the arms are part of the trunk's slices. There the trunk is taken to be no
// wider than just below them. trunk: x of each slice's largest part; top: the highest slice of
// whose side an arm was taken.
struct Reach {
    double low = 0, high = 0;
};
void cut_at_armpits(BodyField& body, const std::vector<Reach>& trunk, int top) {
    constexpr double kBelowMm = 20, kSpareMm = 3;
    const Grid& grid = body.grid();
    Reach reach = trunk[static_cast<std::size_t>(top)];
    for (int k = std::max(0, top - static_cast<int>(kBelowMm / body.voxel_mm())); k < top; ++k) {
        reach.low = std::min(reach.low, trunk[static_cast<std::size_t>(k)].low);
        reach.high = std::max(reach.high, trunk[static_cast<std::size_t>(k)].high);
    }
    for (int k = top + 1; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                const double x = body.point(i, j, k).x;
                if (x < reach.low - kSpareMm || x > reach.high + kSpareMm)
                    body.labels().voxels[grid.index(i, j, k)] = 0;
            }
}

// Parts of a slice that lie to the side of the trunk become air.
void take_arms_off(BodyField& body, double beyond_mm) {
    LabelVolume& labels = body.labels();
    const Grid& grid = body.grid();
    const auto plane =
        static_cast<std::size_t>(grid.size.x) * static_cast<std::size_t>(grid.size.y);
    std::vector<int> part(plane);
    std::vector<std::size_t> stack;
    // The midline is that of the slice with the widest trunk's box: of the whole body.
    const Box3 box = body.box_of(~LabelBits{}.set(0));
    const double middle = box.centre().x;
    std::vector<Reach> trunk;
    int top = -1;
    for (int k = 0; k < grid.size.z; ++k) {
        std::fill(part.begin(), part.end(), -1);
        std::uint8_t* slice = labels.voxels.data() + plane * static_cast<std::size_t>(k);
        struct Part {
            std::size_t count = 0;
            double sum_x = 0;
            Reach reach{1e9, -1e9};
        };
        std::vector<Part> parts;
        for (std::size_t start = 0; start < plane; ++start) {
            if (slice[start] == 0 || part[start] >= 0) continue;
            const int number = static_cast<int>(parts.size());
            parts.push_back({});
            part[start] = number;
            stack.assign(1, start);
            while (!stack.empty()) {
                const std::size_t n = stack.back();
                stack.pop_back();
                const auto sx = static_cast<std::size_t>(grid.size.x);
                ++parts.back().count;
                const double x = body.point(static_cast<int>(n % sx), 0, 0).x;
                parts.back().sum_x += x;
                parts.back().reach.low = std::min(parts.back().reach.low, x);
                parts.back().reach.high = std::max(parts.back().reach.high, x);
                const auto visit = [&](std::size_t m) {
                    if (slice[m] == 0 || part[m] >= 0) return;
                    part[m] = number;
                    stack.push_back(m);
                };
                if (n % sx > 0) visit(n - 1);
                if (n % sx + 1 < sx) visit(n + 1);
                if (n >= sx) visit(n - sx);
                if (n + sx < plane) visit(n + sx);
            }
        }
        std::size_t largest = 0;
        trunk.push_back({});
        for (const Part& p : parts) {
            if (p.count > largest) trunk.back() = p.reach;
            largest = std::max(largest, p.count);
        }
        for (std::size_t n = 0; n < plane; ++n) {
            if (part[n] < 0) continue;
            const Part& p = parts[static_cast<std::size_t>(part[n])];
            const double off = std::abs(p.sum_x / static_cast<double>(p.count) - middle);
            // Legs are as large as each other.
            if (off > beyond_mm && 100 * p.count < 35 * largest) {
                slice[n] = 0;
                // A hand or a speck of an arm says nothing of the armpit.
                if (100 * p.count > 3 * largest) top = k;
            }
        }
    }
    if (top >= 0) cut_at_armpits(body, trunk, top);
}

// What is left: visceral fat in the cavity of the organs, subcutaneous fat, muscle between.
void add_fat(BodyField& body, const BodyOptions& options, const std::vector<float>& depth) {
    const LabelBits organs =
        body.with({"liver",   "spleen",   "kidney", "pancreas", "colon",  "bowel",    "duodenum",
                   "stomach", "bladder",  "uterus", "ovary",    "aorta",  "cava",     "portal",
                   "artery",  "arteries", "vein",   "ureter",   "rectum", "prostate", "gall"});
    const std::vector<float> to_organs = body.distance_to(organs);
    std::vector<std::uint8_t> far(to_organs.size());
    for (std::size_t n = 0; n < far.size(); ++n)
        far[n] = static_cast<double>(to_organs[n]) > options.cavity_mm;
    const std::vector<float> to_far = body.distance_to(far);
    const double wall_mm = options.fat_mm + 0.6 * options.muscle_mm;
    std::vector<std::uint8_t> cavity(far.size());
    for (std::size_t n = 0; n < cavity.size(); ++n)
        cavity[n] = static_cast<double>(to_far[n]) > options.cavity_mm - 1 &&
                    static_cast<double>(depth[n]) > wall_mm;
    const std::vector<float> to_cavity = body.distance_to(cavity);
    const std::uint8_t visceral = body.make("visceral_fat", "fat");
    body.paint(visceral, [&](Point3, std::size_t n) { return cavity[n] != 0; });
    const std::uint8_t muscle = body.make("muscle_wall", "muscle");
    body.paint(muscle, [&](Point3, std::size_t n) {
        return static_cast<double>(
                   to_cavity[n])<options.muscle_mm&& static_cast<double>(depth[n])> 0.6 *
               options.fat_mm;
    });
    add_muscles(body, options, depth);
    const std::uint8_t fat = body.make("subcutaneous_fat", "fat");
    body.paint(fat, [](Point3, std::size_t) { return true; });
}

void report_shares(const LabelVolume& labels, std::size_t given, StageReport& report) {
    std::vector<std::size_t> count(labels.labels.size(), 0);
    for (const std::uint8_t v : labels.voxels) ++count[v];
    std::size_t meshes = 0, all = 0;
    for (std::size_t l = 1; l < count.size(); ++l) {
        all += count[l];
        if (l < given && labels.labels[l].name != "body") meshes += count[l];
    }
    const double share =
        all == 0 ? 0 : 100 * static_cast<double>(meshes) / static_cast<double>(all);
    report.measures.push_back({"from_meshes_percent", share});
    report.measures.push_back({"by_rule_percent", 100 - share});
    report.measures.push_back(
        {"body_volume_ml", static_cast<double>(all) * labels.grid.voxel_volume_mm3() / 1000});
    const int whole = static_cast<int>(std::lround(share));
    report.notes.push_back({"origin", std::to_string(whole) + " % of this body is from meshes, " +
                                          std::to_string(100 - whole) + " % by rule"});
}

}  // namespace

void fill_body(LabelVolume& labels,
               const BodyOptions& options,
               StageReport& report,
               const Progress& progress) {
    const std::size_t given = labels.labels.size();
    BodyField body(labels);
    if (!options.enabled || body.body() == 0) {
        report_shares(labels, given, report);
        if (body.body() == 0)
            report.warnings.push_back(
                "the table gives no node the role body, so nothing is filled "
                "in between the organs; name the skin's node");
        return;
    }
    if (options.arms_off_mm > 0) take_arms_off(body, options.arms_off_mm);
    fill_bladder(body, options);
    report_progress(progress, 0.1, "skin");
    const std::vector<float> depth = body.distance_to(LabelBits{}.set(0));
    const std::uint8_t skin = body.make("skin", "skin");
    body.paint(skin, [&](Point3, std::size_t n) {
        return static_cast<double>(depth[n]) < std::max(options.skin_mm, 0.9 * body.voxel_mm());
    });
    report_progress(progress, 0.25, "spine and chest");
    if (options.spine) add_spine(body, options);
    if (options.stomach) add_stomach(body, options);
    if (options.gall_bladder) add_gall_bladder(body);
    add_chest(body, options, depth);
    report_progress(progress, 0.5, "vessels");
    if (options.leg_vessels) add_leg_vessels(body, options);
    report_progress(progress, 0.6, "fat and muscle");
    add_fat(body, options, depth);
    report_shares(labels, given, report);
    report_progress(progress, 1, "body filled in");
}

}  // namespace sonocase::pipeline
