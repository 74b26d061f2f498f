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
    bool scanned(int column, int row) const;
    // Sets the pixels outside the scanned area, which no run visits.
    template <class T>
    void set_outside(std::span<T> plane, T value) const {
        std::array<T, 64> block;  // copied whole: std::fill takes numbers one by one
        block.fill(value);
        std::size_t at = 0;
        const auto fill_to = [&](std::size_t end) {
            for (; at + block.size() <= end; at += block.size())
                std::copy(block.begin(), block.end(), plane.data() + at);
            std::copy_n(block.begin(), end - at, plane.data() + at);
        };
        for_each_run([&](const TruthRun& run, std::size_t begin) {
            fill_to(begin);
            at = begin + static_cast<std::size_t>(run.count);
        });
        fill_to(plane.size());
    }

  private:
    int width_px_ = 0, rays_ = 0;
    float rays_per_px_at_face_ = 0;
    std::vector<PixelRun> runs_;      // by row, then from the left
    std::vector<std::uint16_t> ray_;  // per scanned pixel, and slack for a vector
    std::vector<float> r_mm_;
};

// Tiles of the picture that show one label throughout, a quarter of a torso's: their pixels are not
// looked up one by one. A tile's places, moved as truth_rows.h moves them, are bounded by a box;
// where all bricks that the box meets hold one label and no surface, so does the tile. Which tiles
// are found changes no pixel.
class PlainTiles {
  public:
    static constexpr int kColumns = 16, kRows = 8;

    PlainTiles(const ScanGeometry& geometry, const TruthPixels& pixels, double contact_reach_mm);

    void find(SimdTarget simd, const TruthFrameRows& frame);  // those of a frame
    // The label that a pixel's tile shows throughout; -1: it may show several.
    int label(int column, int row) const {
        return label_[static_cast<std::size_t>((row / kRows) * across_ + column / kColumns)];
    }

  private:
    struct Tile {
        int rays[2] = {1 << 30, -1};  // the least and the greatest of its scanned pixels
        float r_mm[2] = {1e9f, -1e9f};
        float fade[2] = {0, 1};  // of the gap that contact closes
        // Its middle in the scan plane, mm; the beam through it, and how far those of its pixels
        // turn away from it. any_turn: so near the virtual apex that no bound is known.
        double x = 0, z = 0, dx = 0, dz = 1, turn = 0;
        bool any_turn = false;
    };
    struct Box {
        double middle[3], half[3];  // voxels
    };
    void lay_beam(std::size_t tile);
    bool move(SimdTarget simd, const TruthFrameRows& f, std::size_t tile, Box& box) const;
    static Box breathed_middle(const TruthFrameRows& f, const Box& box);
    static void breathe(const TruthFrameRows& f, Box& box);
    static int label_in(const TruthFrameRows& f, const Box& box);

    const ScanGeometry& geometry_;
    int across_ = 0;
    double half_mm_ = 0;      // from a tile's middle to its corners
    double beam_vx_[3] = {};  // length of the beams' plane along each axis, per mm; of a frame
    std::vector<Tile> tiles_;
    std::vector<std::int16_t> label_;
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
