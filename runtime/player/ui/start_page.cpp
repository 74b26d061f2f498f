// SPDX-License-Identifier: Apache-2.0

// The start page: cases with their pictures and exercises, where to go on, and how to open another.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/scoring/course_standing.h"
#include "formats/text/lower_case.h"
#include "runtime/player/app/next_exercise.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/ui/pages.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/parts/layout.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

constexpr float kPictureShare = 0.625f;  // height by width
constexpr float kExercise = 52;

using Card = std::shared_ptr<const CaseCard>;

bool matches(const std::string& words, const char* search) {
    const auto same = [](char a, char b) { return lower_case(a) == lower_case(b); };
    const std::string wanted = search;
    return std::search(words.begin(), words.end(), wanted.begin(), wanted.end(), same) !=
               words.end() ||
           wanted.empty();
}

struct StandingWords {
    std::string words;
    Icon icon = Icon::target;
    unsigned packed = colour::kDim;
};

StandingWords standing_words(const Progress& progress,
                             const CaseCard& card,
                             const CaseCard::Exercise& exercise) {
    const Standing now =
        standing(progress.history, card.case_name, exercise.name, exercise.mastery);
    StandingWords out;
    const std::string best =
        now.best_mm >= 0 ? std::string(" · ") + tr("best") + text(" %.1f mm", now.best_mm) : "";
    if (now.attempts == 0) {
        out.words = tr("Not tried");
        return out;
    }
    if (now.passes > 0) {
        out.icon = Icon::pass;
        out.packed = colour::kGood;
        if (now.mastered) {
            out.words = tr("Mastered") + best;
            return out;
        }
        out.words = filled(tr("Passed %d of %d"), now.passes, now.attempts) + best;
    } else {
        out.icon = Icon::fail;
        out.packed = colour::kBad;
        out.words = filled(tr("Not passed in %d"), now.attempts) + best;
    }
    return out;
}

using Then = request::OpenCase::Then;

request::OpenCase open_exercise(const BundleChooser& chooser,
                                const std::string& path,
                                int exercise,
                                Then then) {
    std::string name;
    if (const Card card = chooser.cards->find(path);
        card && exercise >= 0 && exercise < static_cast<int>(card->exercises.size()))
        name = card->exercises[exercise].name;
    return {.path = path, .exercise = name, .then = then};
}

void draw_cover(BundleChooser& chooser, Ui& ui, const Box& box, const CaseCard& card) {
    ui.fill(box, colour::kPicture, 6);
    if (card.pixels.empty()) return;
    std::unique_ptr<ImageTexture>& texture = chooser.pictures[card.path];
    if (!texture) {
        texture = std::make_unique<ImageTexture>();
        texture->upload(card.pixels, card.width_px, card.height_px);
    }
    ui.image(texture->id(), box, false, 6);
}

// A case: picture, title, exercises. Returns the height taken; draws only within `shown`.
float draw_case(const Progress& progress,
                BundleChooser& chooser,
                Ui& ui,
                Box box,
                int index,
                Requests& requests) {
    const BundleEntry& entry = chooser.bundles[index];
    const Card card = chooser.cards->find(entry.path);
    const float cover = kPictureShare * (box.w - 24);
    const std::size_t rows = card ? card->exercises.size() : 0;
    box.h = 24 + cover + 8 + 26 + 22 + static_cast<float>(rows) * kExercise;
    ui.card(box, entry.name.c_str());
    if (chooser.cursor == index) ui.fill({box.x, box.y + 6, 3, box.h - 12}, colour::kAccent, 1.5f);
    Box room = box.inset(12);
    const Box picture = room.take_top(cover, 8);
    if (card) {
        draw_cover(chooser, ui, picture, *card);
    } else {
        ui.fill(picture, colour::kPicture, 6);
        ui.text(picture, tr("Loading"), Type::small, colour::kImageText, Align::centre);
    }
    const std::string title = card && !card->title.empty() ? card->title : entry.name;
    ui.text(room.take_top(26), title, Type::heading, colour::kText, Align::left, true);
    const std::string line = card ? filled(tr("%s · %.1f MB · exercises: %zu"), entry.name.c_str(),
                                           entry.megabytes, rows)
                                  : filled(tr("%s · %.1f MB"), entry.name.c_str(), entry.megabytes);
    ui.text(room.take_top(22), line, Type::small, colour::kDim, Align::left, true);
    for (std::size_t i = 0; i < rows; ++i) {
        const CaseCard::Exercise& exercise = card->exercises[i];
        const StandingWords now = standing_words(progress, *card, exercise);
        Box row = room.take_top(kExercise);
        ui.line(row.x, row.y, row.right(), row.y, colour::kLine);
        char id[48];
        std::snprintf(id, sizeof id, "case%d exercise%zu", index, i);
        ButtonStyle style;
        style.ghost = true;
        style.chosen = chooser.cursor == index && chooser.exercise == static_cast<int>(i);
        style.tip = "Opens it; Start practice begins an attempt at once";
        if (ui.button(id, row.inset(0, 2), "", style))
            requests.push_back(open_exercise(chooser, entry.path, static_cast<int>(i), Then::scan));
        ui.begin_in_control();
        ui.icon(now.icon, row.x + 6, row.y + 16, 20, now.packed);
        ui.text({row.x + 36, row.y + 4, row.w - 64, 24}, title_of(exercise), Type::body,
                colour::kText, Align::left, true);
        ui.text({row.x + 36, row.y + 26, row.w - 64, 20}, now.words, Type::small, colour::kDim,
                Align::left, true);
        ui.icon(Icon::next, row.right() - 24, row.y + 16, 20, colour::kDim);
        ui.end_in_control();
    }
    return box.h;
}

// Where the trainee goes on: the exercise tried last, an easier or a harder one; else the first of
// the case under the cursor.
struct Next {
    int bundle = 0, exercise = 0;
    Card card;
};
Next next_exercise(const Progress& progress, const BundleChooser& chooser) {
    Next next;
    next.bundle = std::clamp(chooser.cursor, 0, static_cast<int>(chooser.bundles.size()) - 1);
    next.card = chooser.cards->find(chooser.bundles[next.bundle].path);
    if (!next.card) return next;
    if (chooser.exercise >= 0) {
        next.exercise = chooser.exercise;
    } else {
        std::vector<KnownExercise> known;
        for (const CaseCard::Exercise& e : next.card->exercises)
            known.push_back({e.name, e.difficulty, e.mastery});
        next.exercise = next_exercise_index(known, progress.history, next.card->case_name);
    }
    return next;
}

void draw_continue(
    const Progress& progress, const BundleChooser& chooser, Ui& ui, Box& side, Requests& requests) {
    if (chooser.bundles.empty()) return;
    const Next next = next_exercise(progress, chooser);
    if (!next.card || next.card->exercises.empty()) return;
    const std::string& path = chooser.bundles[next.bundle].path;
    Box card = side.take_top(196, 12);
    ui.card(card, "continue");
    Box room = card.inset(16, 12);
    ui.text(room.take_top(20), tr(progress.history.empty() ? "Begin with" : "Continue"),
            Type::small, colour::kDim);
    const auto index =
        std::min(static_cast<std::size_t>(next.exercise), next.card->exercises.size() - 1);
    ui.text(room.take_top(26), title_of(next.card->exercises[index]), Type::heading, colour::kText,
            Align::left, true);
    ui.text(room.take_top(22, 8), next.card->title, Type::small, colour::kDim, Align::left, true);
    ButtonStyle style;
    style.primary = true;
    style.icon = Icon::live;
    style.key = "Enter";
    style.tip = "Hints and live distances";
    if (ui.button("practice", room.take_top(48, 8), tr("Start practice"), style))
        requests.push_back(open_exercise(chooser, path, static_cast<int>(index), Then::practise));
    style = {};
    style.icon = Icon::lock;
    style.tip = "No hints, no distances";
    if (ui.button("exam", room.take_top(40), tr("Start exam"), style))
        requests.push_back(open_exercise(chooser, path, static_cast<int>(index), Then::exam));
}

request::OpenCase open_guided(const Progress& progress, const BundleChooser& chooser) {
    const Next next = next_exercise(progress, chooser);
    return open_exercise(chooser, chooser.bundles[next.bundle].path, next.exercise, Then::guide);
}

void draw_guide_card(
    const Progress& progress, const BundleChooser& chooser, Ui& ui, Box& side, Requests& requests) {
    if (chooser.bundles.empty() || side.h < 140) return;
    Box card = side.take_top(132, 12);
    ui.card(card, "guide");
    Box room = card.inset(16, 12);
    ui.text(room.take_top(24), tr("New here?"), Type::bold);
    ui.paragraph(room.take_top(36, 4),
                 tr("Five guided minutes: slide, tilt, hold, take the needle, advance."),
                 Type::small, colour::kDim, true);
    ButtonStyle style;
    style.icon = Icon::hint;
    style.tip = "Step by step, before the first attempt";
    if (!ui.button("guided", room.take_top(44), tr("Guided start"), style)) return;
    requests.push_back(open_guided(progress, chooser));
}

void draw_open(BundleChooser& chooser, Screen& screen, Ui& ui, Box& side, Requests& requests) {
    if (side.h >= 60) {
        const Box drop = side.take_top(60, 8);
        for (float x = drop.x; x < drop.right() - 2; x += 10) {
            const float end = std::min(x + 5, drop.right());
            ui.line(x, drop.y, end, drop.y, colour::kEdge, 1.5f);
            ui.line(x, drop.bottom(), end, drop.bottom(), colour::kEdge, 1.5f);
        }
        for (float y = drop.y; y < drop.bottom() - 2; y += 10) {
            const float end = std::min(y + 5, drop.bottom());
            ui.line(drop.x, y, drop.x, end, colour::kEdge, 1.5f);
            ui.line(drop.right(), y, drop.right(), end, colour::kEdge, 1.5f);
        }
        ui.icon(Icon::drop, drop.x + 16, drop.y + 16, 28, colour::kDim);
        ui.text({drop.x + 58, drop.y + 8, drop.w - 66, 24}, tr("Drop a case here"), Type::bold,
                colour::kText, Align::left, true);
        ui.text({drop.x + 58, drop.y + 32, drop.w - 66, 20}, tr("a .sonocase file"), Type::small,
                colour::kDim, Align::left, true);
    }
    if (side.h < 44) return;
    Box row = side.take_top(44, 8);
    if (chooser.typing) {
        const Box go = row.take_right(ui.width(tr("Open"), Type::body) + 24, 8);
        const bool entered = ui.input("##path", row, chooser.path, sizeof chooser.path,
                                      tr("Path of a .sonocase file"));
        if ((ui.button("open", go, tr("Open"), {}) || entered) && chooser.path[0]) {
            requests.push_back(request::OpenCase{.path = chooser.path, .typed = true});
        }
        return;
    }
    ButtonStyle style;
    style.icon = Icon::folder;
    style.tip = "Open a case by its path";
    if (ui.button("browse", row.column(0, 2, 8), tr("Browse"), style)) chooser.typing = true;
    style.icon = Icon::group;
    style.tip = "Everyone's progress";
    if (ui.button("class", row.column(1, 2, 8), tr("Class"), style)) screen.page = Page::group;
}

void draw_faults(const BundleChooser& chooser, Ui& ui, Box& side) {
    for (const BundleEntry& entry : chooser.bundles) {
        const Card card = chooser.cards->find(entry.path);
        if (!card || card->fault.empty() || side.h < 64) continue;
        const Box box = side.take_top(64, 8);
        ui.card(box, "fault");
        ui.icon(Icon::warn, box.x + 12, box.y + 20, 24, colour::kWarn);
        ui.paragraph({box.x + 46, box.y + 8, box.w - 58, 50}, tr_message(card->fault), Type::small,
                     colour::kText, true);
    }
}

void draw_bar(const std::string& trainee, Notices& notices, Screen& screen, Ui& ui, Box bar) {
    ButtonStyle style;
    style.ghost = true;
    style.icon = Icon::settings;
    style.tip = "Settings and panels";
    if (ui.button("settings", bar.take_right(44, 4).inset(0, 2), "", style))
        screen.dialog = Dialog::settings;
    style.icon = Icon::help;
    style.tip = "All keys and gestures (F1)";
    if (ui.button("help", bar.take_right(44, 4).inset(0, 2), "", style))
        screen.dialog = Dialog::help;
    style.icon = Icon::user;
    style.tip = "Sign in as someone else";
    const std::string name = trainee.empty() ? tr("Sign in") : trainee;
    const float wide = std::min(56 + ui.width(name, Type::body), 0.4f * bar.w);
    if (ui.button("user", bar.take_right(wide, 8).inset(0, 2),
                  ui.width(name, Type::body) + 56 > wide ? "" : name, style))
        screen.dialog = Dialog::sign_in;
    if (show_notice(notices, ui, bar)) return;
    ui.text(bar, "Sonocase", Type::heading);
}

void draw_cases(const Progress& progress,
                BundleChooser& chooser,
                Ui& ui,
                Box area,
                int columns,
                Requests& requests) {
    ui.clip(area);
    const Box whole = area;
    area.w -= 10;  // for the bar that shows how far the list was scrolled
    if (chooser.bundles.empty()) {
        const std::string folder =
            data_folder().empty() ? "~/.local/share/sonocase" : data_folder();
        ui.paragraph(area,
                     std::string(tr("No case was found. Drop one here, or copy it to")) + " " +
                         folder + "/cases.\n" + tr("The program sonocase makes one: ") +
                         "sonocase build scenarios/demo-torso/case.toml -o demo.sonocase",
                     Type::body, colour::kDim, true);
    }
    std::vector<float> foot(columns, area.y - static_cast<float>(chooser.scroll));
    for (int i = 0; i < static_cast<int>(chooser.bundles.size()); ++i) {
        const BundleEntry& entry = chooser.bundles[i];
        const Card card = chooser.cards->find(entry.path);
        if (card && !card->fault.empty()) continue;
        bool found = matches(entry.name, chooser.search);
        if (card) {
            found = found || matches(card->case_name, chooser.search) ||
                    matches(card->title, chooser.search);
            for (const auto& exercise : card->exercises)
                found = found || matches(title_of(exercise), chooser.search);
        }
        if (!found) continue;
        // The shortest column takes the next card.
        const auto shortest = std::min_element(foot.begin(), foot.end());
        Box box = area.column(static_cast<int>(shortest - foot.begin()), columns, 16);
        box.y = *shortest;
        *shortest += draw_case(progress, chooser, ui, box, i, requests) + 16;
    }
    ui.unclip();
    const double high = *std::max_element(foot.begin(), foot.end()) + chooser.scroll - area.y;
    ui.scroll_by_wheel(whole, chooser.scroll, std::max(0.0, high - area.h));
}

}  // namespace

void press_primary(const Progress& progress, const BundleChooser& chooser, Requests& requests) {
    if (chooser.bundles.empty() || !chooser.cards) return;
    const Next next = next_exercise(progress, chooser);
    requests.push_back(
        open_exercise(chooser, chooser.bundles[next.bundle].path, next.exercise, Then::practise));
}

void draw_start_page(const Progress& progress,
                     Notices& notices,
                     BundleChooser& chooser,
                     Screen& screen,
                     Ui& ui,
                     Requests& requests) {
    if (!chooser.cards) chooser.cards = std::make_unique<CaseCards>();
    if (!chooser.asked) {
        std::vector<std::string> paths;
        for (const BundleEntry& entry : chooser.bundles) paths.push_back(entry.path);
        chooser.cards->want(paths);
        chooser.pictures.clear();
        chooser.asked = true;
    }
    const Box window = ui.window();
    const PageLayout page = page_layout(window.w, window.h);
    draw_bar(progress.trainee, notices, screen, ui, page.bar);
    Box content = page.content;
    const bool wide = page.columns >= 2;
    Box side = wide ? content.take_right(std::min(312.0f, 0.36f * content.w), 16) : Box{};
    side.take_top(0, wide ? 4.0f : 0.0f);
    Box head = content.take_top(52, 8);
    const Box search = head.take_right(std::min(300.0f, 0.5f * head.w)).inset(0, 4);
    ui.text(head, tr("Cases"), Type::title);
    ui.input("##search", search, chooser.search, sizeof chooser.search,
             tr("Search cases and exercises"));
    if (wide) {
        draw_continue(progress, chooser, ui, side, requests);
        draw_course_card(progress, screen, ui, side);
        draw_guide_card(progress, chooser, ui, side, requests);
        draw_open(chooser, screen, ui, side, requests);
        draw_faults(chooser, ui, side);
        draw_cases(progress, chooser, ui, content, page.columns - 1, requests);
        return;
    }
    Box foot = content.take_bottom(48, 8);
    ButtonStyle style;
    style.primary = true;
    style.key = "Enter";
    style.icon = Icon::live;
    if (ui.button("practice", foot.column(0, 2, 8), tr("Start practice"), style))
        press_primary(progress, chooser, requests);
    style = {};
    style.icon = Icon::hint;
    if (ui.button("guided", foot.column(1, 2, 8), tr("Guided start"), style)) {
        if (!chooser.bundles.empty()) {
            requests.push_back(open_guided(progress, chooser));
        }
    }
    draw_cases(progress, chooser, ui, content, std::max(1, static_cast<int>(content.w / 300)),
               requests);
}

}  // namespace sonocase::runtime::inline player_ui
