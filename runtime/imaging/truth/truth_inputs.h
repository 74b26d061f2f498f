// SPDX-License-Identifier: Apache-2.0

// What the kernels of truth_rows.h read: a bundle's voxels and labels, and the geometry of a
// picture's pixels. And the needle's plane.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "runtime/imaging/core/needle_chord.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/imaging/truth/truth_rows.h"

namespace sonocase::runtime {

// Labels and surfaces of one volume.
class TruthVolume {
  public:
    TruthVolume(const BrickVolume<std::uint8_t>& labels,
                const BrickVolume<std::uint32_t>& boundary);

    void fill(TruthFrameRows& rows) const;

  private:
    const BrickVolume<std::uint8_t>& labels_;
    const BrickVolume<std::uint32_t>& boundary_;
    std::vector<std::uint32_t> boundary_uniform_;  // and kNoBoundary
    std::vector<TruthBrick> bricks_;               // and one for all places outside
    bool plain_boundaries_ = true;
};

class TruthVoxels {
  public:
    // physical: bone and gas are hard; otherwise the tissues that cast a shadow are. The bundle
    // must outlive this.
    TruthVoxels(const CaseBundle& bundle, bool physical);

    // Sets what belongs to the bundle and not to the frame. rows.region points to `region` where
    // model `physical` shows a fine region.
    void fill(TruthFrameRows& rows, TruthFrameRows& region) const;

  private:
    const CaseBundle* bundle_;
    std::vector<std::int32_t> labels_;
    TruthVolume volume_;
    std::optional<TruthVolume> region_;
};

// As std::fill(), which takes floats one by one, and bytes by an instruction that is slow to start.
template <class T>
void fill_plane(std::span<T> plane, T value) {
    std::array<T, 64> block;
    block.fill(value);
    std::size_t at = 0;
    for (; at + block.size() <= plane.size(); at += block.size())
        std::copy(block.begin(), block.end(), plane.data() + at);
    std::copy_n(block.begin(), plane.size() - at, plane.data() + at);
}

// The runs of scanned pixels of a picture, and each pixel's ray and depth; made once.
class TruthPixels {
  public:
    explicit TruthPixels(const ScanGeometry& geometry);

    int rays() const { return rays_; }
    float rays_per_px_at_face() const { return rays_per_px_at_face_; }
    // Calls work(run, offset of the run's first pixel in a plane) for every run.
    template <class Work>
    void for_each_run(const Work& work) const {
        for (const PixelRun& run : runs_) {
            const TruthRun pixels{run.row, run.begin, run.end - run.begin, ray_.data() + run.entry,
                                  r_mm_.data() + run.entry};
            work(pixels, static_cast<std::size_t>(run.row) * width_px_ +
                             static_cast<std::size_t>(run.begin));
        }
    }
    // Sets the pixels outside the scanned area, which no run visits.
    template <class T>
    void set_outside(std::span<T> plane, T value) const {
        std::size_t at = 0;
        for_each_run([&](const TruthRun& run, std::size_t begin) {
            fill_plane(plane.subspan(at, begin - at), value);
            at = begin + static_cast<std::size_t>(run.count);
        });
        fill_plane(plane.subspan(at), value);
    }

  private:
    int width_px_ = 0, rays_ = 0;
    float rays_per_px_at_face_ = 0;
    std::vector<PixelRun> runs_;      // by row, then from the left
    std::vector<std::uint16_t> ray_;  // per scanned pixel, and slack for a vector
    std::vector<float> r_mm_;
};

// The picture in tiles whose pixels' places follow from those of a few points (TruthTile), so that
// contact, pressing and breathing are worked out for a sixteenth of the pixels. Where all bricks
// that a tile's places lie in hold one label and no surface, no pixel is looked up.
class TruthTiles {
  public:
    static constexpr int kColumns = TruthTile::kColumns, kRows = TruthTile::kRows;

    TruthTiles(const ScanGeometry& geometry, const TruthPixels& pixels);

    // Writes a frame's labels of all tiles that have scanned pixels, and of other pixels in them,
    // but for those tiles whose pixels are to be looked up one by one: where beams are in air,
    // lumens close, a needle or a pool moves tissue, a fine region lies, or the middle of a cell of
    // pixels is not where its corners say.
    void look_up(SimdTarget simd, const TruthFrameRows& frame, std::span<std::uint8_t> labels);
    bool any_one_by_one(int row) const {
        return any_in_row_[static_cast<std::size_t>(row / kRows)];
    }
    bool one_by_one(int column, int row) const {
        return one_by_one_[static_cast<std::size_t>((row / kRows) * across_ + column / kColumns)];
    }

  private:
    struct Tile {
        TruthTile points;
        int rays[2] = {1 << 30, -1};  // the least and the greatest of its scanned pixels
        int rows = 0;                 // down to the last with scanned pixels
        PlanePoint middle{};
    };
    bool bends(const press::PressView& view, const Tile& tile) const;
    int columns(const Tile& t) const { return std::min(kColumns, width_px_ - t.points.column); }
    std::uint8_t* first_label(const Tile& t, std::span<std::uint8_t> labels) const {
        return labels.data() + static_cast<std::ptrdiff_t>(t.points.row) * width_px_ +
               t.points.column;
    }
    // A tile on its way: its bricks, then its voxels are asked for while others are worked on.
    struct Waiting {
        const Tile* tile = nullptr;
        TilePlaces places;
        bool inside = true;  // all places lie in the volume
        int from[3], to[3];  // bricks that the places lie in
        TileVoxels voxels;
    };
    enum class Step { done, one_by_one, waits };
    void fill(const Tile& tile, int label, std::span<std::uint8_t> labels) const;
    Step place(SimdTarget simd,
               const TruthFrameRows& frame,
               const Tile& tile,
               std::span<std::uint8_t> labels,
               Waiting& out) const;
    bool find(SimdTarget simd,  // false: its labels are there
              const TruthFrameRows& frame,
              std::span<std::uint8_t> labels,
              Waiting& tile) const;
    void mark_one_by_one(const Tile& tile);
    static int label_of_bricks(const TruthFrameRows& frame, const int from[3], const int to[3]);

    int width_px_ = 0, across_ = 0;
    double half_mm_ = 0;                         // from a tile's middle to its corners
    std::vector<Tile> tiles_;                    // those with scanned pixels
    std::vector<char> one_by_one_, any_in_row_;  // of tiles, and of rows of them
    std::vector<int> air_before_;  // of each ray, and one more: rays in air before it, in a frame
};

// 1 where the slab shows the needle's shaft, 2 within tip_mm of its tip, 0 elsewhere.
void needle_plane(const ScanGeometry& geometry,
                  const TruthPixels& pixels,
                  const NeedleShape& needle,
                  double tip_mm,
                  std::span<std::uint8_t> plane);

// Mirrors each row of a plane; an empty plane stays empty.
template <class T>
void flip_rows(std::span<T> plane, std::size_t width) {
    for (std::size_t at = 0; at < plane.size(); at += width)
        std::reverse(plane.begin() + static_cast<std::ptrdiff_t>(at),
                     plane.begin() + static_cast<std::ptrdiff_t>(at + width));
}

}  // namespace sonocase::runtime
