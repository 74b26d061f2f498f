// SPDX-License-Identifier: Apache-2.0

// A body while it is being filled in: its labels by name, and distances. Internal to the rules.
#pragma once

#include <cstdint>
#include <functional>
#include <initializer_list>
#include <string_view>
#include <vector>

#include "formats/volume/label_volume.h"
#include "pipeline/base/label_set.h"
#include "pipeline/import/body/body_rules.h"

namespace sonocase::pipeline::inline import_body {

class BodyField {
  public:
    explicit BodyField(LabelVolume& labels);

    LabelVolume& labels() { return labels_; }
    const LabelVolume& labels() const { return labels_; }
    const Grid& grid() const { return labels_.grid; }
    double voxel_mm() const { return grid().spacing_mm.x; }
    Point3 point(int i, int j, int k) const {
        return grid().origin_mm + voxel_mm() * Vector3{static_cast<double>(i),
                                                       static_cast<double>(j),
                                                       static_cast<double>(k)};
    }

    std::uint8_t body() const { return body_; }  // 0: there is none
    // The label of that name, which is added to the palette if it is not there.
    std::uint8_t make(const char* name, const char* tissue);
    // Labels whose name holds one of these words.
    LabelSet with(std::initializer_list<std::string_view> words) const;
    LabelSet all() const;  // all labels except the outside and the body

    // Distance in mm to a set of labels, or to marked voxels; 0 inside.
    std::vector<float> distance_to(const LabelSet& labels) const;
    std::vector<float> distance_to(const std::vector<std::uint8_t>& marked) const;

    // Gives `label` to voxels of the body where where(point, n) is true. Slices in parallel.
    template <class Where>
    void paint(std::uint8_t label, Where where, const LabelSet& give_way = {}) {
        paint_slices(
            label, [&](int i, int j, int k, std::size_t n) { return where(point(i, j, k), n); },
            give_way);
    }
    // Gives `label` to voxels of the body, and of the labels that give way, within radius_mm of the
    // path.
    void paint_tube(std::uint8_t label,
                    const std::vector<Point3>& path,
                    double radius_mm,
                    const LabelSet& give_way = {});

    // The bounding box of a set of labels, empty if they have no voxel, and the mean of their
    // voxels.
    Box3 box_of(const LabelSet& labels) const;
    Point3 middle_of(const LabelSet& labels) const;
    // The midline, and the skin's front and back on it, at a height; NaN where there is no body.
    struct Outline {
        double middle_x, back_y, front_y, right_x, left_x;
    };
    const std::vector<Outline>& outlines();  // # slices

  private:
    template <class Where>
    void paint_slices(std::uint8_t label, Where where, const LabelSet& give_way) {
        for_slices([&](int k) {
            for (int j = 0; j < grid().size.y; ++j)
                for (int i = 0; i < grid().size.x; ++i) {
                    const std::size_t n = grid().index(i, j, k);
                    const std::uint8_t now = labels_.voxels[n];
                    if ((now == body_ || give_way[now]) && where(i, j, k, n))
                        labels_.voxels[n] = label;
                }
        });
    }
    void for_slices(const std::function<void(int)>& slice) const;

    LabelVolume& labels_;
    std::uint8_t body_ = 0;
    std::vector<Outline> outlines_;
};

// The rules. Each fills voxels that are still "body".
void add_spine(BodyField& body, const BodyOptions& options);
void add_chest(BodyField& body, const BodyOptions& options, const std::vector<float>& depth);
void add_stomach(BodyField& body, const BodyOptions& options);
void add_leg_vessels(BodyField& body, const BodyOptions& options);
void add_gall_bladder(BodyField& body);
void add_muscles(BodyField& body, const BodyOptions& options, const std::vector<float>& depth);
void fill_bladder(BodyField& body, const BodyOptions& options);

}  // namespace sonocase::pipeline::inline import_body
