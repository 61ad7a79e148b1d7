// A peer in headless Chromium: serves the page, the scene and the peer's modules on the loopback interface, starts the
// browser, and hands the page one batch of frames at a time. Between batches the page waits and uses no processor.

import { spawn } from 'node:child_process';
import { createReadStream } from 'node:fs';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';

const here = path.dirname(fileURLToPath(import.meta.url));
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.json': 'application/json' };

/** Ways to draw WebGL without a graphics processor: Mesa's, and what Chromium carries itself, several times slower here. */
export const SOFTWARE_GL = {
	llvmpipe: { flags: ['--use-gl=angle', '--use-angle=gl-egl'], env: { LIBGL_ALWAYS_SOFTWARE: '1', EGL_PLATFORM: 'surfaceless' } },
	swiftshader: { flags: ['--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'] },
};

export class PeerBrowser {
	#server;
	#browser;
	#profile;
	#waiting = null; // the page's request for work, held open
	#picture = null;
	#expected = null; // {resolve, reject} of the answer that is awaited
	#failure = null;
	#stderr = '';

	/** Loads the scene; resolves to what the page says about itself. */
	async start({ chromium, modules, scene, camera, options, gl, verbose }) {
		this.files = { '/page.html': path.join(here, 'page.html'), '/page.js': path.join(here, 'page.js'), '/scene.ply': scene };
		this.modules = modules;
		this.job = JSON.stringify({ camera, options });
		this.#server = createServer((request, response) => this.#answer(request, response));
		await new Promise((resolve) => this.#server.listen(0, '127.0.0.1', resolve));
		this.#profile = await mkdtemp(path.join(tmpdir(), 'bench-peers-'));
		const kind = SOFTWARE_GL[gl];
		// What makes our programs find lavapipe would hide the browser's own drivers.
		const { VK_DRIVER_FILES, VK_ICD_FILENAMES, VK_LAYER_PATH, LD_LIBRARY_PATH, ...environment } = process.env;
		const ready = this.#expect();
		this.#browser = spawn(chromium, [
			'--headless=new', '--no-first-run', '--no-default-browser-check', '--disable-extensions', '--disable-sync',
			'--disable-background-networking', '--disable-component-update', '--mute-audio', '--force-device-scale-factor=1',
			'--ignore-gpu-blocklist', '--disable-gpu-watchdog', '--disable-background-timer-throttling', '--disable-renderer-backgrounding',
			// Chromium refuses to run as root with its sandbox; only our own page is shown.
			...(process.getuid?.() === 0 ? ['--no-sandbox'] : []),
			...kind.flags, `--user-data-dir=${this.#profile}`, '--window-size=800,600',
			`http://127.0.0.1:${this.#server.address().port}/page.html`,
		], { env: { ...environment, ...kind.env }, stdio: ['ignore', 'ignore', 'pipe'], detached: true });
		this.#browser.on('error', (why) => this.#fail(`cannot start ${chromium}: ${why.message}`));
		this.#browser.on('exit', (code) => this.#fail(`the browser ended (${code}): ${this.#stderr.slice(-2000)}`));
		this.#browser.stderr.on('data', (text) => {
			this.#stderr += text;
			if (verbose) process.stderr.write(text);
		});
		return JSON.parse(await within(ready, 300, 'the peer has not loaded the scene', () => this.#stderr.slice(-2000)));
	}

	/** Draws `frames` frames, each sorted anew; writes the last one's picture if told where. */
	async frames(frames, picture = null) {
		this.#picture = null;
		const done = this.#expect();
		const work = JSON.stringify({ frames, keep: picture !== null });
		if (this.#waiting) {
			send(this.#waiting, 'application/json', work);
			this.#waiting = null;
		} else {
			this.work = work;
		}
		const times = JSON.parse(await within(done, 60 + 20 * frames, 'the peer has not drawn its frames', () => this.#stderr.slice(-2000)));
		if (picture) await writeFile(picture, this.#picture);
		return times;
	}

	async close() {
		this.#failure = new Error('closed');
		this.#expected = null;
		const browser = this.#browser;
		if (browser?.pid && browser.exitCode === null) {
			const ended = new Promise((resolve) => browser.once('exit', resolve));
			try {
				process.kill(-browser.pid, 'SIGKILL');
			} catch {
				// It has ended by itself.
			}
			await ended;
		}
		this.#server?.closeAllConnections();
		this.#server?.close();
		if (this.#profile) await rm(this.#profile, { recursive: true, force: true, maxRetries: 5 });
	}

	#expect() {
		if (this.#failure) return Promise.reject(this.#failure);
		return new Promise((resolve, reject) => {
			this.#expected = { resolve, reject };
		});
	}

	#fail(why) {
		this.#failure ??= new Error(why);
		this.#expected?.reject(this.#failure);
	}

	async #answer(request, response) {
		// Isolated from other origins, the peer may share memory with its sorting thread, which is its faster way.
		response.setHeader('Cross-Origin-Opener-Policy', 'same-origin');
		response.setHeader('Cross-Origin-Embedder-Policy', 'require-corp');
		const url = new URL(request.url, 'http://localhost').pathname;
		if (request.method === 'POST') {
			const parts = [];
			for await (const part of request) parts.push(part);
			const body = Buffer.concat(parts);
			send(response, 'text/plain', '');
			if (url === '/picture') this.#picture = body;
			else if (url === '/failed') this.#fail(`the peer's page failed: ${body}`);
			else this.#expected?.resolve(body.toString());
		} else if (url === '/scene.json') {
			send(response, 'application/json', this.job);
		} else if (url === '/next') {
			if (this.work) {
				send(response, 'application/json', this.work);
				this.work = null;
			} else {
				this.#waiting = response;
			}
		} else {
			const file = this.files[url] ?? (url.startsWith('/node_modules/') ? path.join(this.modules, url.slice('/node_modules'.length)) : null);
			if (!file) {
				response.writeHead(404).end();
				return;
			}
			response.setHeader('Content-Type', TYPES[path.extname(file)] ?? 'application/octet-stream');
			createReadStream(file).on('error', () => response.writeHead(404).end()).pipe(response);
		}
	}
}

function send(response, type, body) {
	response.setHeader('Content-Type', type);
	response.setHeader('Cache-Control', 'no-store');
	response.end(body);
}

/** The promise's value, or what has not happened within so many seconds. */
export async function within(promise, seconds, what, detail) {
	let timer;
	const late = new Promise((_, reject) => {
		timer = setTimeout(() => reject(new Error(`${what} within ${seconds} s. ${detail()}`)), 1000 * seconds);
	});
	try {
		return await Promise.race([promise, late]);
	} finally {
		clearTimeout(timer);
	}
}
