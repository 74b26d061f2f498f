// SPDX-License-Identifier: Apache-2.0

#include "peer_itk.h"

#include <itkAntiAliasBinaryImageFilter.h>
#include <itkImage.h>

namespace sonocase::bench {

std::vector<float> itk_antialiased(const LabelVolume& labels, std::uint8_t label) {
    using Mask = itk::Image<unsigned char, 3>;
    using Field = itk::Image<float, 3>;
    auto mask = Mask::New();
    const Int3 n = labels.grid.size;
    mask->SetRegions(
        Mask::SizeType{{static_cast<itk::SizeValueType>(n.x), static_cast<itk::SizeValueType>(n.y),
                        static_cast<itk::SizeValueType>(n.z)}});
    mask->Allocate();
    bool inside = false, outside = false;
    for (std::size_t v = 0; v < labels.voxels.size(); ++v) {
        const bool own = labels.voxels[v] == label;
        mask->GetBufferPointer()[v] = own;
        inside = inside || own;
        outside = outside || !own;
    }
    std::vector<float> phi(labels.voxels.size(), inside ? -1e3f : 1e3f);
    if (!inside || !outside) return phi;
    auto filter = itk::AntiAliasBinaryImageFilter<Mask, Field>::New();
    filter->SetInput(mask);
    filter->Update();
    const float* out = filter->GetOutput()->GetBufferPointer();
    for (std::size_t v = 0; v < phi.size(); ++v) phi[v] = -out[v];  // ITK's is positive inside
    return phi;
}

}  // namespace sonocase::bench
