// SPDX-License-Identifier: Apache-2.0

// What panels draw with: words, boxes, icons and controls at given places, in u (pixels divided by
// the scale). Every box drawn is kept for a test, which sees that none overlaps another and that no
// words are cut. Dear ImGui decides what is hovered and pressed; its cursor and layout are not
// used.
//
// Controls are walked through with Tab and Shift + Tab; the one in focus has a frame round it, and
// Enter presses it. Words are shown as tr() has them (runtime/player/words/words.h).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "runtime/display/theme.h"
#include "runtime/player/ui/parts/icons.h"
#include "runtime/player/ui/parts/layout.h"

namespace sonocase::runtime::inline player_ui_parts {

enum class Type { small, body, bold, heading, large, title };
enum class Align { left, centre, right };

struct ButtonStyle {
    Icon icon = Icon::none;
    bool primary = false;  // the one filled button of a page
    bool chosen = false;   // a bar at the bottom, and bold
    bool enabled = true;
    bool ghost = false;  // no fill until hovered
    bool link = false;   // words in the accent colour, no fill
    bool tile = false;   // icon above small words
    bool left = false;   // words at the left edge
    // The words are the user's own (a name, a title) or an author's, and may be too long: they are
    // small then, or an ellipsis stands for the rest, and the tooltip shows the whole.
    bool may_cut = false;
    const char* key = "";  // shown as a key cap; empty: none
    const char* tip = "";  // tooltip; empty: none
};

// A box as it was drawn, for tests.
struct DrawnBox {
    enum class Kind { card, control, words, picture } kind = Kind::card;
    Box box;
    int layer = 0;     // 0: the page; higher: over it
    bool cut = false;  // words that did not fit
    std::string name;  // id of a control, or the words
};

class Ui {
  public:
    // Once per picture, before anything is drawn. now_s: for tooltips.
    void begin(float scale, double now_s);
    // After everything: the focus frame and the tooltip.
    void end();
    float scale() const { return scale_; }
    double now_s() const { return now_s_; }
    Box window() const;  // in u

    // A layer over what was drawn so far, with its own input; the page below does not answer. Draw
    // within it until end_layer().
    void begin_layer(const char* id, const Box& box, bool dims);
    void end_layer();

    // Shapes; radius and thickness in u.
    void fill(const Box& box, unsigned packed, float radius = 0);
    void outline(const Box& box, unsigned packed, float thick, float radius = 0);
    void line(float x0, float y0, float x1, float y1, unsigned packed, float thick = 1);
    void disc(float x, float y, float radius, unsigned packed);
    void diamond(float x, float y, float radius, unsigned packed);
    void icon(Icon icon, float x, float y, float side, unsigned packed);
    void curve(const std::vector<float>& xy, unsigned packed, float thick);
    void image(void* texture, const Box& box, bool upside_down = false, float radius = 0);
    // A card: filled, kept as a box that others may lie in.
    void card(const Box& box, const char* name, unsigned packed = colour::kPanel);
    // A picture's place: kept, not drawn.
    void picture(const Box& box, const char* name);
    // What is drawn between the two belongs to the control drawn before, and is not kept.
    void begin_in_control() { quiet_ = true; }
    void end_in_control() { quiet_ = false; }
    void clip(const Box& box);
    void unclip();

    // One line in the middle of the box's height. Too long: cut, with an ellipsis, and the whole as
    // a tooltip; with may_cut that is not a fault.
    void text(const Box& box,
              const std::string& words,
              Type type,
              unsigned packed = colour::kText,
              Align align = Align::left,
              bool may_cut = false);
    // Wrapped, from the top of the box; lines that do not fit are left out, with an ellipsis.
    // Returns the height taken.
    float paragraph(const Box& box,
                    const std::string& words,
                    Type type,
                    unsigned packed = colour::kText,
                    bool may_cut = false);
    float width(const std::string& words, Type type) const;
    float line_height(Type type) const;
    float paragraph_height(float width, const std::string& words, Type type) const;

    // Controls. True: pressed, on release inside or by Enter.
    bool button(const char* id,
                const Box& box,
                const std::string& words,
                const ButtonStyle& style = {});
    // A name, minus, a value and plus. Held, it repeats. -1, 0 or 1.
    int stepper(const char* id,
                const Box& box,
                const std::string& name,
                const std::string& value,
                const char* tip,
                bool enabled = true);
    // A name, a groove with a knob, and the value as words. A double click or Backspace sets
    // `normal`. True if it moved.
    bool slider(const char* id,
                const Box& box,
                const std::string& name,
                double& value,
                double low,
                double high,
                double normal,
                const std::string& shown,
                const char* tip,
                bool enabled = true);
    // The groove alone.
    bool groove(const char* id,
                const Box& box,
                double& value,
                double low,
                double high,
                double normal,
                const char* tip,
                bool enabled = true);
    // A line of text that the user types. True: Enter.
    bool input(const char* id, const Box& box, char* text, std::size_t size, const char* hint);
    // An area that takes the mouse and is not among the controls that Tab walks through.
    struct Area {
        bool hovered = false, held = false, clicked = false, double_clicked = false;
    };
    Area area(const char* id, const Box& box);
    // A row of name and value; packed: of the value.
    void row(const Box& box,
             const std::string& name,
             const std::string& value,
             unsigned packed = colour::kText);
    void tooltip(const std::string& words);
    // Moves `scroll` in [0, max] with the wheel over the box, and shows where it is.
    void scroll_by_wheel(const Box& box, double& scroll, double max);

    // The focus that Tab moves.
    bool has_focus() const { return focus_ != 0; }
    void drop_focus() { focus_ = 0; }

    const std::vector<DrawnBox>& drawn() const { return drawn_; }
    float mouse_x() const;
    float mouse_y() const;

  private:
    float px(float u) const { return u * scale_; }
    struct Press {
        bool hovered = false, held = false, pressed = false, focused = false;
    };
    Press press(const char* id, const Box& box, bool enabled, const char* tip);
    void note(DrawnBox::Kind kind, const Box& box, const std::string& name, bool cut = false);
    void draw_button(const Box& box,
                     const std::string& words,
                     const ButtonStyle& style,
                     const Press& now);
    void show_tip(unsigned id, bool hovered, bool focused, const std::string& words);

    float scale_ = 1;
    double now_s_ = 0;
    int layer_ = 0;
    std::vector<DrawnBox> drawn_;
    std::vector<Box> clips_;
    bool quiet_ = false;  // words inside a control are not kept on their own
    unsigned focus_ = 0, enter_ = 0;
    std::vector<unsigned> order_, order_before_;
    int focus_layer_ = 0, top_layer_ = 0, top_layer_before_ = 0;
    Box focus_box_;
    unsigned hovered_ = 0;
    double hovered_since_s_ = 0;
    std::string tip_;
    Box tip_at_;
    double repeat_s_ = 0;
};

// The button that leaves a page, cut from the left of its bar. True if it was pressed.
bool back_button(Ui& ui, Box& bar, const char* id, const std::string& words, const char* tip);

}  // namespace sonocase::runtime::inline player_ui_parts
