// SPDX-License-Identifier: Apache-2.0

// Solids on a grid: which voxels a surface encloses, by winding numbers, and the lumens of pipes.
//
// The winding number w says how often a surface winds around a point: 1 inside a closed surface, 0
// outside, in between where the surface has holes. A point is inside where w is nearer to 1 than to
// 0.
//
//     w(p) = 1/(4 pi) sum over triangles of their solid angle seen from p
//
// Hierarchical: triangles far away count as one dipole per box, at the area-weighted centre.
// Source: Barill, Dickson, Schmidt, Levin and Jacobson, ACM Trans. Graph. 37:43 (2018), first
// order; direct sum: Jacobson, Kavan and Sorkine-Hornung, ACM Trans. Graph. 32:33 (2013), solid
// angle after van Oosterom and Strackee (1983).
#pragma once

#include <cstdint>
#include <vector>

#include "formats/volume/label_volume.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline::inline import_mesh {

// The direct sum, which is the definition. Cost: 30 ns per triangle.
double winding_number(const Surface& surface, Point3 p);

class WindingTree {
  public:
    // accuracy: a box counts as one dipole from this many of its radii on; 2 is wrong by 0.04 at
    // most on organs, at a fiftieth of the direct sum's time.
    explicit WindingTree(const Surface& surface, double accuracy = 2);
    double at(Point3 p) const;

  private:
    struct Box {
        Point3 centre;
        Vector3 dipole;  // sum of area * normal
        double radius = 0;
        std::uint32_t first = 0, count = 0;  // triangles of a leaf
        std::uint32_t child = 0;             // of two; 0: a leaf
    };
    void build(std::uint32_t box, int depth);
    void summarise(Box& box) const;
    const Surface& surface_;
    double accuracy_;
    std::vector<std::uint32_t> order_;
    std::vector<Box> boxes_;
};

// A solid on a grid: the voxels whose centres its surface winds around.

struct VoxelMask {
    Int3 first{0, 0, 0}, size{0, 0, 0};  // a box of the grid
    std::vector<std::uint8_t> inside;    // # box, x fastest, 0 or 1
    std::size_t index(int i, int j, int k) const {
        return i + static_cast<std::size_t>(size.x) * (j + static_cast<std::size_t>(size.y) * k);
    }
    std::size_t count() const;
};

// Along each row of voxels the winding number changes by one where the row passes a triangle. On a
// closed surface that is all: exact, and right where parts overlap. closed = false: the surface has
// holes, and each piece of a row between triangles asks the tree at its middle,
// at most 8 voxels apart.
// grid: direction the identity. margin_vx: empty voxels kept round the box. Same result for any
// number of threads. Cost: 20 ns per triangle and row; open surfaces 5 us per piece.
VoxelMask voxelise(
    const Surface& solid, bool closed, const Grid& grid, int margin_vx = 2, double accuracy = 2);

// The inside of pipes: a pipe with a wall (vessel, bowel, ureter) is open to the outside, so that
// neither caps nor holes of the solid fill it; its slices are rings, which do.

struct LumenOptions {
    double voxel_mm = 1;
    double hole_mm2 = 900;  // largest hole of a slice that is lumen
};

// The wall is grown by a voxel, which closes small gaps. Holes of the slices along each of the
// three axes, up to the area given, are lumen; they grow by the same voxel and join the wall. Works
// in place and returns the number of voxels added.
std::size_t fill_lumen(VoxelMask& wall, const LumenOptions& options);

}  // namespace sonocase::pipeline::inline import_mesh
