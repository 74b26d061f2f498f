// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/scan/picture_pace.h"

namespace sonocase::runtime {

double longest_wait_s(const Stillness& now) {
    if (now.scanning || now.key_held) return kPictureTime;
    if (now.loading) return kLoadingTime;
    if (now.notice || now.typing || now.input_s_ago < kAfterInput) return kStillTime;
    return kNoPicture;
}

}  // namespace sonocase::runtime
