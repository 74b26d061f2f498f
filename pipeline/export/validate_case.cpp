// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <set>

#include "formats/exercise/exercise.h"
#include "formats/volume/boundary_record.h"
#include "pipeline/export/inspect_case.h"

namespace sonocase::pipeline {
namespace {

class Findings {
  public:
    void error(std::string text) { list_.push_back({true, std::move(text)}); }
    void remark(std::string text) { list_.push_back({false, std::move(text)}); }
    std::vector<Finding> list_;
};

void check_palette(const CaseBundle& bundle, Findings& findings) {
    std::set<std::string> names, tissue_names;
    for (const Tissue& tissue : bundle.tissues)
        if (!tissue_names.insert(tissue.name).second)
            findings.error("two tissues are named '" + tissue.name + "'");
    for (const Label& label : bundle.labels) {
        if (!names.insert(label.name).second)
            findings.error("two labels are named '" + label.name + "'");
        if (tissue_names.count(label.tissue) == 0)
            findings.error("label '" + label.name + "' is of the missing tissue '" + label.tissue +
                           "'");
    }
    const LabelVolumes volumes = label_volumes(bundle);
    double body = 0;
    for (std::size_t i = 1; i < volumes.ml.size(); ++i) {
        body += volumes.ml[i];
        if (volumes.ml[i] == 0)
            findings.remark("label '" + bundle.labels[i].name +
                            "' has no voxel: it was lost on the way");
    }
    if (body == 0) findings.error("the case holds no body");
    for (const Tissue* tissue : tissues_without_texture(bundle))
        findings.error("tissue '" + tissue->name + "' asks for the missing texture '" +
                       tissue->texture + "'");
    if (bundle.speckle.edge == 0)
        findings.remark("no speckle volume: the physical model needs one");
}

// Records name labels of the palette, other than the voxel's own. Every record of a stored brick is
// looked at; a wrong one shows as a speck in the image.
void check_boundary(const CaseBundle& bundle, Findings& findings) {
    if (bundle.boundary.table.empty()) {
        findings.remark("no boundary records: interfaces are drawn from whole voxels");
        return;
    }
    const Int3 size = bundle.grid.size;
    std::uint64_t strange = 0, same = 0;
    for (int k = 0; k < size.z; ++k)
        for (int j = 0; j < size.y; ++j)
            for (int i = 0; i < size.x; ++i) {
                const std::uint32_t packed = bundle.boundary.at(i, j, k);
                if (packed == kNoBoundary) continue;
                const int second = unpack_boundary(packed).second_label;
                if (second >= static_cast<int>(bundle.labels.size()))
                    ++strange;
                else if (second == bundle.label_bricks.at(i, j, k))
                    ++same;
            }
    if (strange > 0)
        findings.error(std::to_string(strange) +
                       " boundary records name labels beyond the palette");
    if (same > 0)
        findings.error(std::to_string(same) + " boundary records name their voxel's own label");
}

void check_surface(const Surface& surface, const Grid& grid, const char* what, Findings& findings) {
    if (surface.points.empty()) {
        findings.remark(std::string("no ") + what + " surface");
        return;
    }
    Box3 box = grid.bounds();
    const Vector3 far{200, 200, 200};  // a mannequin may be longer than the scan
    box.include(box.lower - far);
    box.include(box.upper + far);
    std::size_t away = 0;
    for (const Point3 p : surface.points) away += box.contains(p) ? 0 : 1;
    if (away > 0)
        findings.error(std::string(what) + " surface has " + std::to_string(away) +
                       " points far from the volume: frames are mixed up");
    for (const auto& triangle : surface.triangles)
        for (const std::uint32_t corner : triangle)
            if (corner >= surface.points.size()) {
                findings.error(std::string(what) + " surface has a triangle without its points");
                return;
            }
}

void check_exercises(const CaseBundle& bundle, Findings& findings) {
    std::set<std::string> names;
    if (bundle.exercises.empty()) findings.remark("no exercise");
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        if (!names.insert(embedded.name).second)
            findings.error("two exercises are named '" + embedded.name + "'");
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        if (!exercise) {
            findings.error(exercise.error().message());
            continue;
        }
        for (const Target& target : exercise->targets) {
            const Point3 v = bundle.grid.voxel_from_point(target.centre);
            const auto index = [](double x) { return static_cast<int>(std::lround(x)); };
            const bool near = std::abs(v.x) < 1e6 && std::abs(v.y) < 1e6 && std::abs(v.z) < 1e6;
            const bool inside = near && bundle.grid.contains(index(v.x), index(v.y), index(v.z)) &&
                                bundle.label_bricks.at(index(v.x), index(v.y), index(v.z)) != 0;
            if (!inside)
                findings.error(embedded.name + ": target '" + target.name +
                               "' lies outside the body");
        }
    }
}

}  // namespace

std::vector<const Tissue*> tissues_without_texture(const CaseBundle& bundle) {
    std::vector<const Tissue*> found;
    for (const Tissue& tissue : bundle.tissues) {
        const auto its_own = [&](const SolidTexture& t) { return t.name == tissue.texture; };
        if (!tissue.texture.empty() &&
            std::none_of(bundle.textures.begin(), bundle.textures.end(), its_own))
            found.push_back(&tissue);
    }
    return found;
}

std::vector<Finding> validate_case(const CaseBundle& bundle) {
    Findings findings;
    check_palette(bundle, findings);
    check_boundary(bundle, findings);
    check_surface(bundle.patient_skin, bundle.grid, "patient", findings);
    check_surface(bundle.mannequin_skin, bundle.grid, "mannequin", findings);
    check_exercises(bundle, findings);
    if (bundle.preview_png.empty()) findings.remark("no preview picture");
    return std::move(findings.list_);
}

}  // namespace sonocase::pipeline
