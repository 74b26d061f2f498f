// SPDX-License-Identifier: Apache-2.0

// glTF 2.0 binary (GLB), read here because VTK's reader loses the names of the nodes.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "formats/volume/surface.h"

namespace sonocase::pipeline::inline import_mesh {

struct MeshNode {
    std::string file;  // its name without folder
    std::string name;  // of the node; of a file without nodes, its stem
    Surface surface;   // points and triangles; node transforms applied
};

// Triangles of every node that has a mesh, in the file's own axes and units (metres, y up). Errors,
// one line each: not GLB; cut off; compressed (an extension is required); buffers in other files;
// primitives that are not triangles; indices or accessors beyond their buffer.
Result<std::vector<MeshNode>> read_glb(std::span<const std::uint8_t> bytes,
                                       const std::string& where);

}  // namespace sonocase::pipeline::inline import_mesh
