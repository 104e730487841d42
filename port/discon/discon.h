/* discon.h: a Bladed-style controller library that puts itself between a simulator and its controller, so that any
 * OpenFAST, Bladed or HAWC2 run with any controller streams like a turbine with aeolid in its controller.
 *
 *   simulator --DISCON--> libaeolid_discon.so --DISCON--> the user's controller
 *                              |  taps pitch, torque, speed, accelerations, moments ...; filters; streams
 *                              +--> slcan listeners, SocketCAN, a frame log
 *
 * USE
 *   1 Put libaeolid_discon.so and a settings file libaeolid_discon.cfg (example.cfg shows it, settings.h lists every
 *     key) into one folder.
 *   2 Name the controller in the settings: controller = libdiscon.so.
 *   3 Name the wrapper to the simulator. OpenFAST, ServoDyn input file: DLL_FileName "…/libaeolid_discon.so",
 *     DLL_ProcName "DISCON"; DLL_InFile stays the controller's. Nothing else changes.
 *   The environment variable AEOLID_DISCON names another settings file. Copies of the wrapper under other names
 *   (libaeolid_discon_T2.so; copies, not links) have settings files of their own (libaeolid_discon_T2.cfg).
 *   Built on Linux; not offered on Windows. The legacy interface only: neither CONTROLLER(turbine_id) of Bladed 4.8 nor
 *   a supercontroller's DISCON_SC.
 *
 *   The first call says on standard output what is tapped, how fast, and where the frames go, the last what was sent
 *   (announce.h); channels whose offset and scale hide them from the filter are named on standard error (scale_watch.h).
 *
 * WHAT IS FORWARDED
 *   Every call, whatever its status (-8 and -9 of OpenFAST too), with the very arguments: the controller works on the
 *   simulator's array and strings. Nothing in them is changed but demands while excitation is on (demands.h).
 *   aviFAIL and avcMSG are the controller's. Exceptions:
 *     Settings that cannot be read, a controller that cannot be loaded: there is nothing to call. aviFAIL = -1, avcMSG
 *     says why and what helps, within record 49 characters, final zero included.
 *     What fails in this library alone (a bus that is not there, a filter that cannot be had) never stops the turbine:
 *     aviFAIL stays the controller's, one sentence goes to standard error, and into avcMSG at the first call where the
 *     controller put nothing there; the controller goes on. (OpenFAST shows avcMSG only where aviFAIL is not 0.)
 *   The wrapper reads records 1, 2, 3, 10, 28, 42 ... 47, 49, 60, 61 and those of the channels; an array has at least
 *   64.
 *
 * EXCITATION AND THE CONTROLLER'S OWN MEMORY
 *   A controller that measures pitch sees what was added, once the actuator has followed, and counters it: a closed
 *   loop as any. One that goes on from its own last demand does not see it, in the array (demands_restore) or in its
 *   own variables: its rate and range limits then hold for its own part of the demand, and those in the settings for
 *   the sum. The tapped demand is the sum; the excitation is a channel of its own, so that either part can be had from
 *   the other. To the pitch actuator's limits it is part of the demand: choose amplitude and rate well inside them.
 *   (OpenFAST repeats the demand it got in record 11, the excitation included; that record is left as it is.)
 *
 * WHICH TURBINE A CALL BELONGS TO
 *   A simulator keeps one avrSWAP array per turbine, so its address is the key. Status 0 (or -9) from an unknown
 *   address is a new turbine. A simulator that moves its array from call to call (scripts that copy it) is understood
 *   as long as one turbine runs: with two, such a call is refused with aviFAIL = -1, and the remedy is one copy of the
 *   wrapper each. Each turbine has a controller with static variables of its own (controller.h), which ends with its
 *   last call (status -1): stream finished, bus closed, library unloaded. A first call without a last one before it
 *   starts filter and excitation afresh and leaves the controller loaded, as it would be without the wrapper.
 *
 * CONTRACT
 *   Memory: at the first call of a turbine one block (55 kB), the filter's words and the snapshot (observer.h), for tcp
 *   and pty 4.2 MB more; released with the last call. No heap in between. 64 turbines a process.
 *   Time added to a call, 2 inputs, 3 outputs, p = 20, every tenth call filtered (bench.c of the tests, AMD EPYC):
 *   median 0.5 us, with a filtered sample 2 us, 99.9 % point 6 ... 10 us; 6,200 instructions on average.
 *   No call blocks but the first (`wait`, loading) and the last (listeners take what is left, a few seconds at most).
 *   A file bus writes to the page cache once a second.
 *   Threads: different turbines may be called from different threads at once; calls of one turbine one after another.
 */
#ifndef AEOLID_DISCON_H
#define AEOLID_DISCON_H

/* One call of the simulator. avrSWAP: the records; aviFAIL: 0 done, above 0 done with a message, below 0 stop;
 * accINFILE, avcOUTNAME: texts for the controller; avcMSG: record 49 characters for a message. */
void DISCON(float *avrSWAP, int *aviFAIL, const char *accINFILE, char *avcOUTNAME, char *avcMSG);

#endif
/* SPDX-License-Identifier: MIT */
