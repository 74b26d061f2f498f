// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/image_module.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <exception>

namespace sonocase::pipeline::inline texture {
namespace {

double full_of(OIIO::TypeDesc::BASETYPE type) {
    using T = OIIO::TypeDesc;
    switch (type) {
        case T::UINT8:
        case T::INT8: return 255;
        case T::UINT16: return 65535;
        case T::INT16: return 32767;
        case T::UINT32: return 4294967295.0;
        case T::INT32: return 2147483647;
        default: return 0;
    }
}

std::string on_one_line(std::string text) {
    std::replace(text.begin(), text.end(), '\n', ' ');
    return text;
}

}  // namespace

ImageFailure sonocase_read_image(const char* path,
                                 int frame,
                                 StoredImage& image,
                                 std::string& why) try {
    OIIO::ImageSpec configuration;
    configuration["oiio:UnassociatedAlpha"] = 1;
    const auto input = OIIO::ImageInput::open(path, &configuration);
    if (!input) {
        why = on_one_line(OIIO::geterror());
        return ImageFailure::not_an_image;
    }
    if (!input->seek_subimage(frame, 0)) return ImageFailure::no_frame;
    const OIIO::ImageSpec spec = input->spec();
    image.width = spec.width;
    image.height = spec.height;
    image.depth = spec.depth;
    image.channels = spec.nchannels;
    image.alpha = spec.alpha_channel;
    image.full = full_of(static_cast<OIIO::TypeDesc::BASETYPE>(spec.format.basetype));
    constexpr int kMax = 16384;
    if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1 || spec.width > kMax ||
        spec.height > kMax || spec.nchannels > 8 || spec.depth > 1) {
        return ImageFailure::size;
    }
    image.value.resize(static_cast<std::size_t>(spec.width) * spec.height * spec.nchannels);
    if (!input->read_image(frame, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT,
                           image.value.data())) {
        why = on_one_line(input->geterror());
        return ImageFailure::damaged;
    }
    return ImageFailure::none;
} catch (const std::exception& failure) {
    why = failure.what();
    return ImageFailure::other;
}

}  // namespace sonocase::pipeline::inline texture
