// SPDX-License-Identifier: Apache-2.0

// The type of voxels by ITK's name. Only for .cpp files of this folder that include ITK.
#pragma once

#include <itkImageIOBase.h>

#include <optional>

#include "pipeline/import/volume/native_volume.h"

namespace sonocase::pipeline::inline import_volume {

// Empty for types that are not plain numbers.
inline std::optional<Component> component_of(itk::IOComponentEnum type) {
    using E = itk::IOComponentEnum;
    constexpr bool long_is_64 = sizeof(long) == 8;
    switch (type) {
        case E::UCHAR: return Component::u8;
        case E::CHAR: return Component::i8;
        case E::USHORT: return Component::u16;
        case E::SHORT: return Component::i16;
        case E::UINT: return Component::u32;
        case E::INT: return Component::i32;
        case E::ULONG: return long_is_64 ? Component::u64 : Component::u32;
        case E::LONG: return long_is_64 ? Component::i64 : Component::i32;
        case E::ULONGLONG: return Component::u64;
        case E::LONGLONG: return Component::i64;
        case E::FLOAT: return Component::f32;
        case E::DOUBLE: return Component::f64;
        default: return std::nullopt;
    }
}

}  // namespace sonocase::pipeline::inline import_volume
