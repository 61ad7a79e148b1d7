// A peer that is a program of its own, as rust-peer/ is: it gets SCENE.ply CAMERAS.json ID, says in a line of JSON that it is ready, and answers
// each line {"frames": N, "picture": FILE or null} with a line of times. Between turns it waits for the next line and uses no processor.

import { spawn } from 'node:child_process';
import { createInterface } from 'node:readline';
import { within } from './peer.mjs';

export class PeerProgram {
	#child;
	#lines;
	#stderr = '';

	/** Starts it and loads the scene; resolves to what the program says about itself. */
	async start({ program, repo, scene, cameraFile, id, verbose }) {
		// Our programs' environment: the same Vulkan driver for both.
		const start = 'env=$(./run env) && eval "$env" && exec ${MON3TR_RUNNER:-} "$@"';
		this.#child = spawn('bash', ['-c', start, program, program, scene, cameraFile, String(id)], { cwd: repo, stdio: 'pipe' });
		this.#child.stdin.on('error', () => {}); // It has ended, which the next answer tells.
		this.#child.stderr.on('data', (text) => {
			this.#stderr += text;
			if (verbose) process.stderr.write(text);
		});
		this.#lines = createInterface({ input: this.#child.stdout })[Symbol.asyncIterator]();
		return this.#answer(300, 'the peer has not loaded the scene');
	}

	/** Draws `frames` frames, each sorted anew; writes the last one's picture if told where. */
	async frames(frames, picture = null) {
		this.#child.stdin.write(`${JSON.stringify({ frames, picture })}\n`);
		return this.#answer(60 + 20 * frames, 'the peer has not drawn its frames');
	}

	async close() {
		const child = this.#child;
		if (!child?.pid || child.exitCode !== null || child.signalCode !== null) return;
		const ended = new Promise((resolve) => child.once('exit', resolve));
		child.kill('SIGKILL');
		await ended;
	}

	async #answer(seconds, late) {
		const { value, done } = await within(this.#lines.next(), seconds, late, () => this.#stderr.slice(-2000));
		if (done) throw new Error(`the peer ended: ${this.#stderr.slice(-2000)}`);
		return JSON.parse(value);
	}
}
