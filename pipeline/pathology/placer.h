// SPDX-License-Identifier: Apache-2.0

// One lesion after the other: finds its place, makes its shape, paints it. Internal to pathology.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/pathology/pathology_kinds.h"
#include "pipeline/pathology/label_canvas.h"
#include "pipeline/pathology/lesion_parts.h"
#include "pipeline/pathology/lesion_place.h"
#include "pipeline/pathology/pathology.h"

namespace sonocase::pipeline {

std::string ml_text(double value);  // three digits
double ball_radius_mm(double volume_ml);
double ball_volume_ml(double radius_mm);

// The same rank a hair aslant, so that no two voxels tie: volumes are then exact for shapes and
// levels that lie along the voxels. A level leans by 0.06 degrees.
VoxelField untied(VoxelField rank);

inline constexpr double kSwellReachMm = 40;  // and of the depth of a vessel

class Placer {
  public:
    Placer(const PathologyInput& input, PathologyResult& result)
        : input_(input), result_(result), canvas_(input.cooked, input.boundary) {
        for (std::size_t l = 0; l < input.palette.size(); ++l) {
            const Tissue* tissue = tissue_named(input.palette[l].tissue);
            const bool skin = input.palette[l].tissue == "skin";
            if (tissue == nullptr) continue;
            if (tissue->kind == TissueKind::outside || tissue->kind == TissueKind::bone || skin)
                fixed_.set(l);
            if (tissue->name == "blood" || tissue->name == "vein" || tissue->name == "artery")
                vessels_.set(l);
        }
        fixed_.set(0);
    }

    Status place(const PathologyRequest& request);
    void finish() {
        result_.boundary = canvas_.take_boundary();
        result_.volume = canvas_.take_volume();
    }

  private:
    struct Context {
        const PathologyRequest& request;
        const PathologyKind& kind;
        std::string where;
        Labels host;
        double voxel_mm = 1;
        double volume_ml = 0;
        std::size_t voxels = 0;  // of volume_ml
        double host_ml = 0;
        Vector3 down;
    };

    const Tissue* tissue_named(const std::string& name) const {
        for (const Tissue& tissue : input_.tissues)
            if (tissue.name == name) return &tissue;
        return nullptr;
    }
    Vector3 voxel_of(Point3 given, bool in_mannequin) const {
        if (!in_mannequin && input_.mannequin_from_ct) given = input_.mannequin_from_ct(given);
        return canvas_.grid().voxel_from_point(given) - Point3{};
    }
    std::uint8_t label_at(Vector3 v) const {
        const Int3 n{static_cast<int>(std::lround(v.x)), static_cast<int>(std::lround(v.y)),
                     static_cast<int>(std::lround(v.z))};
        return canvas_.grid().contains(n.x, n.y, n.z) ? canvas_.label(n) : std::uint8_t{0};
    }
    std::string name_at(Vector3 v) const { return canvas_.volume().labels[label_at(v)].name; }
    Vector3 gravity() const;
    double volume_of(const Labels& labels) const;
    Result<Labels> named(const std::vector<std::string>& names, const std::string& where) const;
    Result<Context> context(const PathologyRequest& request) const;
    const Clearances& clearances(const Labels& host, bool skin);

    Result<Lesion> rounded(const Context& c);
    Result<Vector3> centre_of(const Context& c, const RoughEllipsoid& shape, double radius_mm);
    Error no_room(const Context& c, const RoughEllipsoid& shape, const PlaceRules& rules);
    Result<Lesion> bulge(const Context& c, const RoughEllipsoid& shape, double radius_mm);
    Result<Lesion> pool(const Context& c);
    Result<Lesion> swelling(const Context& c);
    Result<Lesion> tube(const Context& c);
    Result<Lesion> filled(const Context& c,
                          const VoxelRange& range,
                          const VoxelField& rank,
                          const VoxelField& limit,
                          const Labels& into,
                          std::size_t voxels);
    PlaceRules rules_of(const Context& c) const;

    const PathologyInput& input_;
    PathologyResult& result_;
    LabelCanvas canvas_;
    Labels fixed_, vessels_;
    std::vector<PlacedLesion> earlier_;
    struct Known {
        Labels host;
        bool skin;
        std::unique_ptr<Clearances> clear;
    };
    std::vector<Known> known_;
};

}  // namespace sonocase::pipeline
