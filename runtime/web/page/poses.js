// SPDX-License-Identifier: Apache-2.0

// Probe and needle of a tracker on another program: `sonoplay --serve-poses`, named by ?poses=ws://... in the page's
// address. Messages are those of runtime/tracking/devices/pose_server.h.

import {t} from './words.js';

const kLongestTrackerWaitMs = 10000;

// {probe, needle} of a message, needle may be null; null: it is not one of ours.
export function parse_poses(text) {
    let message;
    try {
        message = JSON.parse(text);
    } catch {
        return null;
    }
    const good = (rows) => Array.isArray(rows) && rows.length === 16 && rows.every((x) => Number.isFinite(x));
    if (!good(message?.probe) || !(message.needle === null || good(message.needle))) return null;
    return {probe: message.probe, needle: message.needle, tracker: 'poses'};
}

export class PoseSource {
    // say(words): '' when all is well
    constructor(url, say) {
        Object.assign(this, {url, say, tries: 0, newest: null});
        this.connect();
    }
    // The newest pose since the last call; null: none has come.
    take() {
        const newest = this.newest;
        this.newest = null;
        return newest;
    }
    connect() {
        let socket;
        try {
            socket = new WebSocket(this.url);
        } catch {
            this.say(t('The address of the tracker is wrong: ?poses= takes what sonoplay --serve-poses prints.'));
            return;
        }
        socket.onmessage = (e) => {
            const poses = typeof e.data === 'string' ? parse_poses(e.data) : null;
            if (!poses) return;
            this.newest = poses;
            this.tries = 0;
            this.say('');
        };
        // Refused, lost, or not allowed by the site (publish --poses): a page is not told which.
        socket.onclose = () => {
            this.say(t('No tracker answers: start sonoplay --serve-poses, and open this page with the address that it prints.'));
            setTimeout(() => this.connect(), Math.min(500 * 2 ** this.tries++, kLongestTrackerWaitMs));
        };
    }
}
