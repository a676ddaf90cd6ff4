# What other packages may import from here: name and module, read by `__init__.py`.

from .database import database_tables as database_tables
from .evaluation import comparison_sentence as comparison_sentence, comparison_table as comparison_table, evaluation_headline as evaluation_headline, evaluation_tables as evaluation_tables, experiment_figures as experiment_figures, experiment_markdown as experiment_markdown, experiment_tables as experiment_tables, paris_points as paris_points
from .evaluation_html import evaluation_page as evaluation_page
from .identifiability import check_tables as check_tables, identifiability_page as identifiability_page, identifiability_tables as identifiability_tables
from .outcomes import draw_map as draw_map
from .page import html_page as html_page, markdown_page as markdown_page, write_page as write_page, write_report as write_report
from .paper.report import reproduction_report as reproduction_report
from .plots import COLOURS as COLOURS, DARK as DARK, GRID as GRID, GROUND as GROUND, INK as INK, Picture as Picture, blank_figure as blank_figure, draw_curve as draw_curve, draw_legend as draw_legend, draw_plot as draw_plot, in_the_dark as in_the_dark, label as label, saved as saved
from .quality import ClassQuality as ClassQuality, QualityReport as QualityReport, quality_report as quality_report, quality_tables as quality_tables, update_tables as update_tables
from .report_model import Curve as Curve, Number as Number, OutcomeMap as OutcomeMap, Pair as Pair, Plot as Plot, Report as Report, Scene as Scene, SceneObject as SceneObject, Section as Section
from .scenes import MARKERS as MARKERS, cell_scene as cell_scene, draw_scene as draw_scene, draw_scenes as draw_scenes, example_scenes as example_scenes, failure_pairs as failure_pairs
from .tables import Table as Table, WIDEST as WIDEST, brief_notes as brief_notes, distortion_rows as distortion_rows, figure as figure, interval as interval, note_tables as note_tables, number_table as number_table
