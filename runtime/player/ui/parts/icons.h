// SPDX-License-Identifier: Apache-2.0

// The icons: strokes on a grid of 24 by 24, drawn as vectors at any size.
#pragma once

struct ImDrawList;

namespace sonocase::runtime::inline player_ui_parts {

enum class Icon {
    none,
    cases,
    back,
    next,
    up,
    down,
    plus,
    minus,
    close,
    check,
    help,
    settings,
    user,
    group,
    freeze,
    live,
    pause,
    measure,
    zoom,
    text,
    body,
    camera,
    clip,
    flip,
    automatic,
    probe,
    needle,
    target,
    hint,
    eye,
    eyeoff,
    warn,
    fail,
    pass,
    cube,
    swap,
    home,
    again,
    replay,
    review,
    folder,
    drop,
    timer,
    link,
    lost,
    rec,
    lungs,
    liver,
    kidney,
    vessel,
    deep,
    lock,
    sound,
    menu,
    save,
    edit,
};

// x, y: top left, in pixels; side: of the square that the grid fills. packed: as of
// runtime/display/theme.h.
void draw_icon(ImDrawList* draw, Icon icon, float x, float y, float side, unsigned packed);

}  // namespace sonocase::runtime::inline player_ui_parts
