// SPDX-License-Identifier: Apache-2.0

// read_bundle BUNDLE: the labels of a case, with their tissues and volumes in millilitres.
#include <cstdio>
#include <vector>

#include "formats/files/load_save.h"
#include "sonocase/version.h"

using namespace sonocase;

int main(int argc, char** argv) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: read_bundle BUNDLE (sonocase %s)\n", SONOCASE_VERSION);
        return 2;
    }
    const Result<CaseBundle> bundle = load_bundle(argv[1]);
    if (!bundle) {
        std::fprintf(stderr, "read_bundle: %s\n", bundle.error().message().c_str());
        return 1;
    }
    const Grid& grid = bundle->grid;
    std::vector<double> voxels(bundle->labels.size());
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i) ++voxels[bundle->label_bricks.at(i, j, k)];
        }
    }
    const double voxel_mm = grid.spacing_mm.x;  // a bundle's voxels are cubes
    const double voxel_ml = voxel_mm * voxel_mm * voxel_mm / 1000;
    std::printf("%s: %d x %d x %d voxels of %g mm\n", bundle->manifest.case_name.c_str(),
                grid.size.x, grid.size.y, grid.size.z, voxel_mm);
    for (std::size_t n = 1; n < bundle->labels.size(); ++n) {  // 0 is outside the body
        const Label& label = bundle->labels[n];
        std::printf("%-24s %-16s %10.1f ml\n", label.name.c_str(), label.tissue.c_str(),
                    voxels[n] * voxel_ml);
    }
    return 0;
}
