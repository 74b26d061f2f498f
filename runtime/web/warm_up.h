// SPDX-License-Identifier: Apache-2.0

// A small case of the program's own, for a browser to see the program run before the real case is
// there: it compiles what runs often for speed, and the first picture need not wait for that.
#pragma once

#include <memory>

#include "runtime/web/page_player.h"

namespace sonocase::runtime::inline web {

// A round body with a vessel, the physical model. Null: it cannot be made.
std::unique_ptr<PagePlayer> warm_up_player(int side_px);

}  // namespace sonocase::runtime::inline web
