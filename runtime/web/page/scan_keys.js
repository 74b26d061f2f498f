// SPDX-License-Identifier: Apache-2.0

// What the keys do on the scanning page, by position.
const kMostSliders = /^Digit[1-8]$/;
const within = (x, low, high) => Math.min(Math.max(x, low), high);

// One press of a key; true if it did something.
export function press_key(scan, code, {shift}, repeated) {
    const v = scan.values;
    const digit = [...scan.hands.held].some((one) => kMostSliders.test(one));
    if (shift && /^Digit[1-4]$/.test(code)) {
        if (!repeated) scan.doppler.choose(['off', 'colour', 'spectral', 'm_mode'][Number(code.slice(5)) - 1]);
        return true;
    }
    const stepping = {
        BracketLeft: () => scan.set_image({depth_mm: v.depth_mm - 10}),
        BracketRight: () => scan.set_image({depth_mm: v.depth_mm + 10}),
        Semicolon: () => scan.set_image({focus_mm: v.focus_mm - 5}),
        Quote: () => scan.set_image({focus_mm: v.focus_mm + 5}),
        Comma: () => digit || scan.look_back((scan.frozen ? scan.back : 0) + 1),
        Period: () => digit || scan.look_back((scan.frozen ? scan.back : 0) - 1),
    };
    const once = {
        Space: () => scan.freeze(!scan.frozen),
        KeyP: () => { scan.playing = scan.frozen && !scan.playing; },
        KeyN: () => scan.toggle_needle(!shift),
        KeyM: () => scan.measure(!scan.measuring),
        Enter: () => scan.measuring && scan.cross && scan.measure_point(scan.cross),
        KeyC: () => scan.clear(),
        KeyV: () => scan.view3d.show_it(!scan.view3d.on),
        KeyF: () => scan.flip(),
        KeyG: () => scan.auto_gain(),
        KeyB: () => scan.toggle_attempt(),
        KeyH: () => scan.next_hint(),
        ...shift ? {} : {KeyJ: () => scan.perform_nth(0), KeyK: () => scan.perform_nth(1), KeyL: () => scan.perform_nth(2), KeyI: () => scan.perform_nth(3)},
        Home: () => { scan.core.calls.probe_home(); scan.touched(); },
        Digit0: () => scan.level(),
        F1: () => scan.page.help(),
        F2: () => scan.page.to_cases(),
        F4: () => scan.doppler.sounds(!scan.doppler.audio),
        F5: () => scan.page.choose_exercise(Number(document.getElementById('exercise').value) + (shift ? -1 : 1)),
        F6: () => scan.choose_model(!v.model_paper),
        F11: () => scan.full_screen(),
        F12: () => scan.save_picture(),
    };
    const act = stepping[code] ?? (repeated ? undefined : once[code]);
    act?.();
    return Boolean(act);
}

// Words that name keys by the letters of an American keyboard, with those of this one. layout: code to letter, as
// navigator.keyboard.getLayoutMap() gives it.
const kPunctuation = {',': 'Comma', '.': 'Period', '[': 'BracketLeft', ']': 'BracketRight', ';': 'Semicolon', '\'': 'Quote', '-': 'Minus', '=': 'Equal'};
export function key_words(words, layout) {
    return words.replace(/(?<![\p{L}\d-])[A-Z](?![\p{L}\d-])|(?<=^|\s)[,.[\];'=-](?=\s|$)/gu, (key) => {
        const own = layout.get(kPunctuation[key] ?? `Key${key}`) ?? key, large = own.toUpperCase();
        return large.length === 1 ? large : own;
    });
}

// Keys of the console that act while they are held.
export function hold_console(scan, seconds, axis, held) {
    const gain = axis('Minus', 'Equal');
    if (gain) scan.set_console({gain_db: within(scan.console.gain_db + 12 * gain * seconds, -30, 30)});
    const digit = [...held].find((one) => kMostSliders.test(one)), by = axis('Comma', 'Period');
    if (digit && by) {
        const n = Number(digit.slice(5)) - 1;
        scan.set_tgc(n, scan.console.tgc_db[n] + 12 * by * seconds);
    }
}
